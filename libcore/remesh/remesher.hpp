#pragma once

/// The course of one remesh: which operation works on which list, and when.

#include <functional>

#include "remesh/operators.hpp"
#include "remesh/remesh.hpp"

namespace malleus::remeshing {

template <int D, class Metric>
class Remesher {
 public:
  Remesher(WorkingMesh<D, Metric>& mesh, const Background<D, Metric>& background, const RemeshOptions& options)
      : mesh_(mesh), options_(options), operators_(mesh, background) {}

  /// Elements' keys and vertices' metrics must be set, and the mesh renumbered.
  void run(RemeshReport& report);

 private:
  void settle_sizes();
  void untangle();
  void improve();
  void mend_worst();
  void enlist_all();
  void renumber_all();
  Real longest_waiting() const;
  void split_pass(Real threshold);
  void collapse_pass(Real threshold);
  void swap_pass(Real key);
  void balance_pass();
  void move_pass();
  bool collapse_edges(LocalId element, Real threshold);
  void renumber_if_grown();
  void timed(const char* phase, const std::function<void()>& work);

  WorkingMesh<D, Metric>& mesh_;
  const RemeshOptions& options_;
  Operators<D, Metric> operators_;
  std::vector<RemeshPhase> phases_;
  std::vector<std::uint64_t> refused_;  ///< edges that could not be collapsed in this pass, by a hash
  LocalId ordered_elements_ = 0;        ///< how many there were at the last renumbering
  bool tangled_ = true;                 ///< inverted elements may be left
};

/// Quality of all elements and lengths of all edges.
template <int D, class Metric>
RemeshQuality assess(const WorkingMesh<D, Metric>& mesh);

}  // namespace malleus::remeshing
