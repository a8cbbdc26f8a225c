#pragma once

/// Named values that live on the mesh, and what a remesh or a migration does to them.

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mesh/mesh.hpp"

namespace malleus {

enum class Support { domain, element, node };  ///< one value | P0, one per element | P1, one per node
enum class Transfer {
  interpolate,
  conserve,
  recompute
};  ///< at a remesh: P1 interpolation | keep the integral | reset to 0

struct FieldSpec {
  std::string name;  ///< as in outputs: "velocity"
  std::string unit;  ///< SI: "m/s"; "1" where it has none
  Support support = Support::node;
  int components = 1;  ///< 1 scalar, dim vector, symmetric tensor xx yy xy or xx yy zz xy yz xz
  Transfer transfer = Transfer::interpolate;
  bool positive = false;  ///< a transfer keeps it >= 0

  bool operator==(const FieldSpec&) const = default;
};

/// Values on the current mesh, [entity][component]; nodes: owned, then copies. Created by FieldStore alone; a
/// reference stays valid through remeshing and migration.
class Field {
 public:
  const FieldSpec& spec() const noexcept { return spec_; }
  int components() const noexcept { return spec_.components; }
  std::span<Real> values() noexcept { return values_; }
  std::span<const Real> values() const noexcept { return values_; }
  Real* at(LocalId entity) { return values_.data() + static_cast<std::size_t>(entity) * spec_.components; }
  const Real* at(LocalId entity) const { return values_.data() + static_cast<std::size_t>(entity) * spec_.components; }

  /// Replaces all values: as many as the field holds, or those of a new mesh about to be put in place.
  void assign(std::vector<Real> values) { values_ = std::move(values); }

 private:
  friend class FieldStore;
  explicit Field(FieldSpec spec) : spec_(std::move(spec)) {}
  FieldSpec spec_;
  std::vector<Real> values_;
};

/// The fields of a scene by name. A scene declares only those that its equations need.
class FieldStore {
 public:
  /// The field of that name, made (zero, sized for `mesh`) where it is new. Declared again, the spec must be the
  /// same (else Defect). Local, alike on all ranks.
  Field& declare(const Mesh& mesh, const FieldSpec& spec);
  bool has(std::string_view name) const;
  Field& operator[](std::string_view name);  ///< Defect that lists the known names where there is none
  const Field& operator[](std::string_view name) const;
  void remove(std::string_view name);

  /// In the order of declaration.
  std::vector<Field*> all();
  std::vector<const Field*> all() const;

  /// Number of entities of a support on this rank.
  static std::size_t entities(const Mesh& mesh, Support support);

 private:
  std::vector<std::unique_ptr<Field>> fields_;
};

}  // namespace malleus
