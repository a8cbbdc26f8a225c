#include "meshtool/commands.hpp"

int main(int argc, char** argv) {
  return malleus::meshtool::run_meshtool(argc, argv);
}
