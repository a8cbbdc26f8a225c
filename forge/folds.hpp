#pragma once

/// Laps in the making: creases of a body's free surface that close.

#include <nlohmann/json.hpp>
#include <vector>

#include "forge/contact_flow.hpp"

namespace malleus::forge {

/// A crease that became sharper than the limit, where no tool stands in it.
struct Fold {
  Real time = 0;  ///< s, when it was first seen
  std::string body;
  std::array<Real, 3> place = {};       ///< m, then
  std::array<Real, 3> last_place = {};  ///< m, when it was last seen: it moves with the material
};

/// Looks for nodes of the free surface around which the material fills more than nine tenths of all directions (a
/// crease sharper than 36 degrees). Creases nearer to a known one than some edges are the same. A crease narrower than
/// an edge is not seen.
class FoldWatch {
 public:
  explicit FoldWatch(const Scene& scene) : scene_(scene) {}

  /// Looks at the mesh as it is; touching: nodes that are no candidates. Warns of new folds. Collective.
  void look(Real time, std::span<const Touching> touching);
  const std::vector<Fold>& folds() const noexcept { return folds_; }

  nlohmann::json save() const;
  void restore(const nlohmann::json& list);

 private:
  struct Candidate {
    LocalId node = -1;
    Real share = 0;
  };
  std::vector<Candidate> candidates(std::span<const Touching> touching) const;
  /// Place and region of the sharpest candidate of all ranks that `counts`; nothing where there is none. Collective.
  template <class Counts>
  std::optional<std::pair<Vector, std::size_t>> sharpest(const std::vector<Candidate>& list, Counts counts) const;

  const Scene& scene_;
  std::vector<Fold> folds_;
};

}  // namespace malleus::forge
