#pragma once

/// forge as a simulator: its sections, and how a case becomes a forging process.

#include "engine/simulator.hpp"
#include "forge/forge_case.hpp"

namespace malleus::forge {

class ForgeSimulator final : public Simulator {
 public:
  std::string program() const override { return "forge"; }
  std::string description() const override {
    return "Hot forging: viscoplastic bodies under contact and friction with tools and with each other.";
  }
  CommonSections& common() override { return case_.common; }
  void forget() override { case_ = {}; }
  const TimeSettings& time() const override { return case_.time; }
  void describe(CaseReader& reader) override {
    case_.describe(reader);
    case_.validate(reader);
  }
  std::unique_ptr<Process> assemble(const Communicator& comm, Mesh mesh, CaseReader& reader) override;

 private:
  ForgeCase case_;
};

}  // namespace malleus::forge
