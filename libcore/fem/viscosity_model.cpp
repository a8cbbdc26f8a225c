#include "fem/viscosity_model.hpp"

#include <algorithm>

#include "base/error.hpp"

namespace malleus {

void RegionViscosity::evaluate(const Mesh& mesh, std::span<const Real> shear_rate, std::span<Real> viscosity,
                               std::span<Real> slope) const {
  const auto elements = static_cast<std::size_t>(mesh.elements());
  std::size_t begin = 0;
  while (begin < elements) {  // a run of elements of one region at a time
    const auto region = mesh.element_region[begin];
    std::size_t end = begin + 1;
    while (end < elements && mesh.element_region[end] == region) ++end;
    const auto* law = laws_.at(static_cast<std::size_t>(region)).get();
    const std::size_t count = end - begin;
    if (law != nullptr) {
      law->evaluate(shear_rate.subspan(begin, count), viscosity.subspan(begin, count), slope.subspan(begin, count));
    } else {
      std::fill_n(viscosity.begin() + static_cast<std::ptrdiff_t>(begin), count, 0.0);
      std::fill_n(slope.begin() + static_cast<std::ptrdiff_t>(begin), count, 0.0);
    }
    begin = end;
  }
}

Real RegionViscosity::sensitivity() const {
  Real smallest = 1;
  for (const auto& law : laws_) {
    if (law != nullptr) smallest = std::min(smallest, law->sensitivity());
  }
  return smallest;
}

bool RegionViscosity::is_linear() const {
  return std::all_of(laws_.begin(), laws_.end(), [](const auto& law) { return law == nullptr || law->is_linear(); });
}

void GivenViscosity::evaluate(const Mesh& mesh, std::span<const Real>, std::span<Real> viscosity,
                              std::span<Real> slope) const {
  check(viscosity_.size() == static_cast<std::size_t>(mesh.elements()), "a viscosity for each element");
  std::copy(viscosity_.begin(), viscosity_.end(), viscosity.begin());
  std::fill(slope.begin(), slope.end(), 0.0);
}

}  // namespace malleus
