#pragma once

/// Texts for users, from the descriptions that a CaseReader gathered. All local.

#include <string>
#include <string_view>

#include "case/schema.hpp"

namespace malleus {

/// `--help-case [SECTION]`: every section and key with type, unit, default, range and meaning; or those of one section.
/// Throws InputError (with the nearest name) where there is no such section.
std::string help_text(const CaseReader& reader, std::string_view section = "");

/// `--template`: a commented starter case. What is required, or has a starter value, stands uncommented.
std::string template_text(const CaseReader& reader, std::string_view program);

/// The documentation page: a table a section.
std::string markdown_page(const CaseReader& reader, std::string_view program);

}  // namespace malleus
