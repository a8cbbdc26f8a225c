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
  /// A formula of the temperature T [K] alone, see at_temperature(). Errors as parse(). Local.
  static Expression parse_of_temperature(std::string_view text);

  bool is_constant() const { return formula_ == nullptr; }
  bool depends_on_position() const;
  bool depends_on_time() const;
  const std::string& text() const { return text_; }

  /// At one point; unused coordinates are 0.
  Real operator()(const std::array<Real, 3>& point, Real time) const;

  /// At many points: coordinates [points][dimension], dimension 1 to 3; values [points].
  void evaluate(std::span<const Real> coordinates, int dimension, Real time, std::span<Real> values) const;

  /// The same, throwing InputError (file, line and key, formula, point and time) where a value is not finite. Local: in
  /// parallel within agree().
  Real finite_at(const std::array<Real, 3>& point, Real time) const;
  void evaluate_finite(std::span<const Real> coordinates, int dimension, Real time, std::span<Real> values) const;

  /// Of a formula of the temperature [K], or a constant; throws InputError where it is not finite. Local.
  Real at_temperature(Real temperature) const;

  /// "case.ini:12: [reference] pressure", for messages; empty where no case file gave it.
  const std::string& source() const { return source_; }
  void set_source(const std::string& source) { source_ = source; }

 private:
  class Formula;

  static Expression compile(std::string_view text, bool is_of_temperature);
  [[noreturn]] void refuse_value(const std::array<Real, 3>& point, Real time, Real value) const;

  std::string text_;
  std::string source_;
  Real constant_ = 0;
  std::shared_ptr<Formula> formula_;
};

}  // namespace malleus
