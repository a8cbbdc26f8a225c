#include "inject/mixture.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "base/log.hpp"
#include "fem/cut_simplex.hpp"
#include "mesh/simplex.hpp"
#include "parallel/agreement.hpp"

namespace malleus::inject {
namespace {

/// Share of an element below which it is empty, beside void.
constexpr Real least_filled = 0.01;

/// Edge of the regular simplex of that volume.
Real element_size(int dim, Real volume) {
  return dim == 2 ? std::sqrt(4 / std::sqrt(3.0) * volume) : std::cbrt(6 * std::sqrt(2.0) * volume);
}

std::unique_ptr<const ViscousLaw> make_law(const FluidSettings& fluid, Real cut_off) {
  using Law = FluidSettings::Law;
  switch (fluid.law) {
    case Law::newtonian:
      if (!fluid.viscosity->is_constant()) return nullptr;
      return std::make_unique<NewtonianLaw>(fluid.reference_viscosity());
    case Law::power_law:
      return std::make_unique<NortonHoffLaw>(
          NortonHoff{*fluid.consistency, fluid.exponent, fluid.exponent == 1 ? 0 : cut_off});
    case Law::carreau_yasuda:
      return std::make_unique<CarreauYasudaLaw>(CarreauYasuda{fluid.reference_viscosity(), fluid.infinite_viscosity,
                                                              *fluid.time_constant, fluid.exponent, fluid.transition});
    case Law::cross:
      return std::make_unique<CrossLaw>(
          Cross{fluid.reference_viscosity(), fluid.infinite_viscosity, *fluid.time_constant, fluid.exponent});
    case Law::empty:
      break;
  }
  return nullptr;
}

/// [element][dimension]
std::vector<Real> centroids_of(const Mesh& mesh) {
  const auto dim = static_cast<std::size_t>(mesh.dim);
  std::vector<Real> centroids(static_cast<std::size_t>(mesh.elements()) * dim, 0);
  for (LocalId e = 0; e < mesh.elements(); ++e) {
    for (const LocalId node : mesh.nodes_of_element(e)) {
      for (std::size_t c = 0; c < dim; ++c) {
        centroids[static_cast<std::size_t>(e) * dim + c] += mesh.point(node)[c] / (mesh.dim + 1);
      }
    }
  }
  return centroids;
}

}  // namespace

Real share_of(MixtureLaw law, std::span<const Real> level_set, Real size, Real thickness) {
  if (law == MixtureLaw::fraction || law == MixtureLaw::harmonic) return positive_fraction(level_set);
  Real mean = 0;
  for (const Real value : level_set) mean += value / static_cast<Real>(level_set.size());
  if (law == MixtureLaw::sharp) return mean > 0 ? 1 : 0;
  return std::clamp(0.5 + mean / (2 * thickness * size), 0.0, 1.0);
}

MixedViscosity mix(MixtureLaw law, std::span<const Real> shares, std::span<const MixedViscosity> fluids) {
  MixedViscosity mixed;
  if (law != MixtureLaw::harmonic) {
    for (std::size_t k = 0; k < shares.size(); ++k) {
      mixed.viscosity += shares[k] * fluids[k].viscosity;
      mixed.slope += shares[k] * fluids[k].slope;
    }
    return mixed;
  }
  Real modelled = 0;
  Real inverse = 0;
  Real inverse_slope = 0;
  for (std::size_t k = 0; k < shares.size(); ++k) {
    if (shares[k] == 0 || fluids[k].viscosity == 0) continue;
    modelled += shares[k];
    inverse += shares[k] / fluids[k].viscosity;
    inverse_slope += shares[k] * fluids[k].slope / (fluids[k].viscosity * fluids[k].viscosity);
  }
  if (inverse == 0) return mixed;
  // With void in the element: the harmonic mean of the rest, diluted.
  mixed.viscosity = modelled * modelled / inverse;
  mixed.slope = modelled * modelled * inverse_slope / (inverse * inverse);
  return mixed;
}

Mixture::Mixture(std::vector<Fluid> fluids, int background, MixtureLaw law, Real thickness)
    : fluids_(std::move(fluids)), background_(background), law_(law), thickness_(thickness) {}

void Mixture::update(const Mesh& mesh, const std::vector<FluidLevelSet>& level_sets) {
  const auto n = static_cast<std::size_t>(mesh.elements());
  shares_.assign(fluids_.size(), std::vector<Real>(n, 0));
  with_dim(mesh.dim, [&](auto d) {
    constexpr int D = decltype(d)::value;
    std::array<Real, D + 1> nodal;
    for (std::size_t e = 0; e < n; ++e) {
      const auto element = static_cast<LocalId>(e);
      const Real size = element_size(D, simplex_volume<D>(simplex_points<D>(mesh, element)));
      Real sum = 0;
      for (const FluidLevelSet& level_set : level_sets) {
        const auto nodes = mesh.nodes_of_element(element);
        for (std::size_t i = 0; i <= D; ++i) nodal[i] = level_set.values[static_cast<std::size_t>(nodes[i])];
        Real& share = shares_[static_cast<std::size_t>(level_set.fluid)][e];
        share = share_of(law_, nodal, size, thickness_);
        sum += share;
      }
      shares_[static_cast<std::size_t>(background_)][e] = std::max(0.0, 1 - sum);
      if (sum <= 1) continue;
      for (const FluidLevelSet& level_set : level_sets) shares_[static_cast<std::size_t>(level_set.fluid)][e] /= sum;
    }
  });
  if (has_void()) settle_void();
}

bool Mixture::has_void() const {
  const Fluid& fluid = fluids_[static_cast<std::size_t>(background_)];
  return fluids_.size() > 1 && !fluid.law && !fluid.is_given;
}

void Mixture::settle_void() {
  std::vector<Real>& empty = shares_[static_cast<std::size_t>(background_)];
  for (std::size_t e = 0; e < empty.size(); ++e) {
    if (empty[e] <= 1 - least_filled) continue;
    for (std::vector<Real>& share : shares_) share[e] = 0;
    empty[e] = 1;
  }
  for (const auto& [element, fluid] : fed_) {
    const auto e = static_cast<std::size_t>(element);
    shares_[static_cast<std::size_t>(fluid)][e] += empty[e];
    empty[e] = 0;
  }
}

Real Mixture::density(LocalId element) const {
  Real density = 0;
  for (std::size_t k = 0; k < fluids_.size(); ++k) {
    density += shares_[k][static_cast<std::size_t>(element)] * fluids_[k].density;
  }
  return density;
}

void Mixture::evaluate_fluid(const Fluid& fluid, const Mesh& mesh, std::span<const Real> shear_rate,
                             std::span<Real> viscosity, std::span<Real> slope) const {
  std::fill(viscosity.begin(), viscosity.end(), 0);
  std::fill(slope.begin(), slope.end(), 0);
  if (fluid.law) fluid.law->evaluate(shear_rate, viscosity, slope);
  if (fluid.is_given) fluid.given.evaluate(centroids_of(mesh), mesh.dim, 0, viscosity);
  for (std::size_t e = 0; e < viscosity.size(); ++e) {
    if (viscosity[e] >= fluid.lowest) continue;
    viscosity[e] = fluid.lowest;
    slope[e] = 0;
  }
}

void Mixture::evaluate(const Mesh& mesh, std::span<const Real> shear_rate, std::span<Real> viscosity,
                       std::span<Real> slope) const {
  const std::size_t n = viscosity.size();
  if (fluids_.size() == 1) {
    evaluate_fluid(fluids_[0], mesh, shear_rate, viscosity, slope);
    return;
  }
  std::vector<std::vector<Real>> viscosities(fluids_.size(), std::vector<Real>(n));
  std::vector<std::vector<Real>> slopes = viscosities;
  for (std::size_t k = 0; k < fluids_.size(); ++k) {
    evaluate_fluid(fluids_[k], mesh, shear_rate, viscosities[k], slopes[k]);
  }
  std::vector<Real> shares(fluids_.size());
  std::vector<MixedViscosity> pure(fluids_.size());
  for (std::size_t e = 0; e < n; ++e) {
    for (std::size_t k = 0; k < fluids_.size(); ++k) {
      shares[k] = shares_[k][e];
      pure[k] = {viscosities[k][e], slopes[k][e]};
    }
    const MixedViscosity mixed = mix(law_, shares, pure);
    viscosity[e] = mixed.viscosity;
    slope[e] = mixed.slope;
  }
}

Real Mixture::sensitivity() const {
  Real smallest = 1;
  for (const Fluid& fluid : fluids_) {
    if (fluid.law) smallest = std::min(smallest, fluid.law->sensitivity());
  }
  return smallest;
}

bool Mixture::is_linear() const {
  return std::all_of(fluids_.begin(), fluids_.end(), [](const Fluid& f) { return !f.law || f.law->is_linear(); });
}

std::vector<Fluid> make_fluids(const InjectCase& settings, Real cut_off, Real contrast) {
  Real thickest = 0;
  for (const FluidSettings& fluid : settings.fluids) thickest = std::max(thickest, fluid.reference_viscosity());
  std::vector<Fluid> fluids;
  for (const FluidSettings& source : settings.fluids) {
    Fluid& fluid = fluids.emplace_back();
    fluid.name = source.name;
    fluid.law = make_law(source, cut_off);
    fluid.is_given = source.law == FluidSettings::Law::newtonian && !source.viscosity->is_constant();
    if (fluid.is_given) fluid.given = *source.viscosity;
    fluid.density = source.density.value_or(0);
    if (source.law == FluidSettings::Law::empty) continue;
    fluid.lowest = std::max(thickest / contrast, std::numeric_limits<Real>::min());
    if (source.reference_viscosity() < fluid.lowest && !fluid.is_given) {
      log::info(
          "the viscosity of {} is taken as {:.3g} Pa.s in place of {:.3g}: no fluid is more than {:g} times as thick "
          "as "
          "another ([front] contrast)",
          fluid.name, fluid.lowest, source.reference_viscosity(), contrast);
    }
  }
  return fluids;
}

void check_given_viscosities(const Communicator& comm, const Mesh& mesh, const std::vector<Fluid>& fluids) {
  for (const Fluid& fluid : fluids) {
    if (!fluid.is_given) continue;
    agree(comm, [&] {
      std::vector<Real> viscosity(static_cast<std::size_t>(mesh.elements()));
      fluid.given.evaluate_finite(centroids_of(mesh), mesh.dim, 0, viscosity);
      const auto lowest = std::min_element(viscosity.begin(), viscosity.end());
      if (lowest == viscosity.end() || *lowest > 0) return;
      throw InputError(fmt::format("{}: expression '{}' gives {:.6g} Pa.s in some element; a viscosity is above zero",
                                   fluid.given.source(), fluid.given.text(), *lowest));
    });
  }
}

}  // namespace malleus::inject
