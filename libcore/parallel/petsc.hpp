#pragma once

/// PETSc objects that end with their scope, and its error codes as exceptions.

#include <petscsys.h>

#include <utility>

#include "base/error.hpp"

namespace malleus {

/// Throws Defect where a PETSc call failed; PETSc has printed its own message by then.
inline void petsc_call(PetscErrorCode code, const std::source_location& place = std::source_location::current()) {
  check(code == 0, "a PETSc call succeeds", place);
}

/// Owns one PETSc object: Mat, Vec, KSP and so on. Destroy is XxxDestroy. The destruction is collective.
template <class Object, PetscErrorCode (*Destroy)(Object*)>
class PetscOwner {
 public:
  PetscOwner() = default;
  explicit PetscOwner(Object object) : object_(object) {}
  PetscOwner(const PetscOwner&) = delete;
  PetscOwner& operator=(const PetscOwner&) = delete;
  PetscOwner(PetscOwner&& other) noexcept : object_(std::exchange(other.object_, nullptr)) {}
  PetscOwner& operator=(PetscOwner&& other) noexcept {
    std::swap(object_, other.object_);
    return *this;
  }
  ~PetscOwner() { reset(); }

  Object get() const noexcept { return object_; }
  explicit operator bool() const noexcept { return object_ != nullptr; }

  /// For the XxxCreate(..., &object) calls: destroys what is held first.
  Object* out() {
    reset();
    return &object_;
  }
  void reset() {
    if (object_ != nullptr) Destroy(&object_);
    object_ = nullptr;
  }

 private:
  Object object_ = nullptr;
};

}  // namespace malleus
