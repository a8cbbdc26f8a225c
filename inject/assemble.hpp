#pragma once

/// From a filling case and a mesh to the process that runs it: the page of the algorithm.

#include "engine/simulator.hpp"
#include "inject/sections.hpp"

namespace malleus::inject {

/// The program `inject`.
class InjectSimulator final : public Simulator {
 public:
  std::string program() const override { return "inject"; }
  std::string description() const override { return "fills cavities with viscous fluids"; }
  CommonSections& common() override { return case_.common; }
  void forget() override { case_ = {}; }
  const TimeSettings& time() const override { return case_.time; }
  void describe(CaseReader& reader) override;
  std::unique_ptr<Process> assemble(const Communicator& comm, Mesh mesh, CaseReader& reader) override;

 private:
  InjectCase case_;
};

}  // namespace malleus::inject
