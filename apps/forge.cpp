#include "forge/assemble.hpp"

int main(int argc, char** argv) {
  malleus::forge::ForgeSimulator simulator;
  return malleus::run_simulator(argc, argv, simulator);
}
