#pragma once

/// Formulas of x, y, z and t in case files, evaluated by muParser.

#include <array>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "base/types.hpp"

namespace malleus {

/// A number or a formula of position (m) and time (s), with a value in SI. muParser's syntax; `pi`, `e`, `_pi`, `_e`.
/// A formula without variables is folded to its number. Copies share the compiled formula; one thread at a time.
/// Values may be not finite (1/x at 0): who evaluates tests and reports them with the place. Floating-point traps do
/// not fire while a formula is evaluated.
class Expression {
 public:
  Expression() : Expression(0) {}
  explicit Expression(Real constant);

  /// Throws InputError that quotes the text and names the position of what is not understood. Local.
  static Expression parse(std::string_view text);

  bool is_constant() const { return formula_ == nullptr; }
  bool depends_on_position() const;
  bool depends_on_time() const;
  const std::string& text() const { return text_; }

  /// At one point; unused coordinates are 0.
  Real operator()(const std::array<Real, 3>& point, Real time) const;

  /// At many points: coordinates [points][dimension], dimension 1 to 3; values [points].
  void evaluate(std::span<const Real> coordinates, int dimension, Real time, std::span<Real> values) const;

 private:
  class Formula;

  std::string text_;
  Real constant_ = 0;
  std::shared_ptr<Formula> formula_;
};

}  // namespace malleus
