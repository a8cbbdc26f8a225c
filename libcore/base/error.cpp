#include "base/error.hpp"

#include <fmt/format.h>

namespace malleus {

Defect::Defect(const std::string& message, const std::source_location& place)
    : std::logic_error(fmt::format("{} ({}:{}, {})", message, place.file_name(), place.line(), place.function_name())) {
}

}  // namespace malleus
