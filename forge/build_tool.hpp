#pragma once

/// A tool from its section of the case.

#include "forge/forge_case.hpp"
#include "forge/tool.hpp"
#include "parallel/communicator.hpp"

namespace malleus::forge {

/// Reads the tool's files on every rank. InputError. Collective.
Tool build_tool(const Communicator& comm, const ToolSettings& settings, int dim);

/// CSV rows of time [s] and position [m]; a first line that is no number is a header. Times increase strictly.
StrokeTable read_stroke_table(const std::string& text, const std::string& name);

}  // namespace malleus::forge
