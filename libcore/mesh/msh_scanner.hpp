#pragma once

/// The look over an MSH file that finds its layout. Local: one rank does it.

#include "mesh/file_reader.hpp"
#include "mesh/msh_layout.hpp"

namespace malleus {

/// Reads headers and goes over the data. InputError as described at find_msh_layout().
MshLayout scan_msh(const std::string& path);

}  // namespace malleus
