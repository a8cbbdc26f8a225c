#include "engine/simulator.hpp"
#include "inject/assemble.hpp"

int main(int argc, char** argv) {
  malleus::inject::InjectSimulator simulator;
  return malleus::run_simulator(argc, argv, simulator);
}
