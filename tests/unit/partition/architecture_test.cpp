#include "partition/architecture.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "base/error.hpp"
#include "partition/machine_probe.hpp"
#include "support/scratch_directory.hpp"
#include "support/world.hpp"

namespace malleus {
namespace {

using test::world;

class Architectures : public testing::Test {
 protected:
  std::string put(const std::string& name, const std::string& text) {
    const std::string path = (scratch_.path() / name).string();
    if (world().is_root()) std::ofstream(path) << text;
    world().barrier();
    return path;
  }
  Architecture read(const std::string& text, int parts) {
    return read_architecture(world(), put("machine.ini", text), parts);
  }
  void expect_refused(const std::string& text, int parts, const std::string& reason) {
    try {
      read(text, parts);
      ADD_FAILURE() << "was accepted: " << text;
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(reason), std::string::npos) << error.what();
    }
  }

  test::ScratchDirectory scratch_;
};

TEST_F(Architectures, AreReadWithTheirExceptions) {
  const Architecture machine =
      read("[architecture]\nspeed = 1 1 1.5 1.5 ; fast half\nbandwidth = 10\nlink.0-1 = 100\nlink.3-2 = 5\n", 4);
  EXPECT_EQ(machine.speed, (std::vector<Real>{1, 1, 1.5, 1.5}));
  EXPECT_EQ(machine.link(0, 1), 100);
  EXPECT_EQ(machine.link(1, 0), 100);
  EXPECT_EQ(machine.link(2, 3), 5);
  EXPECT_EQ(machine.link(0, 2), 10);
  EXPECT_EQ(machine.total_speed(), 5);
  EXPECT_FALSE(machine.has_equal_links());
  EXPECT_FALSE(machine.has_equal_speeds());
}

TEST_F(Architectures, MayBeClustersOrAMatrix) {
  const Architecture clusters =
      read("[architecture]\nspeed = 2\nbandwidth = 1\ncluster = 0 0 1 1\ncluster_bandwidth = 0.05\n", 4);
  EXPECT_EQ(clusters.link(0, 1), 1);
  EXPECT_EQ(clusters.link(1, 2), 0.05);
  EXPECT_TRUE(clusters.are_alike(0, 1));
  EXPECT_FALSE(clusters.are_alike(1, 2));
  put("links.txt", "0 1 0.05\n1 0 2\n0.05 2 0\n");
  const Architecture matrix = read("[architecture]\nbandwidth = links.txt\n", 3);
  EXPECT_EQ(matrix.link(0, 1), 1);
  EXPECT_EQ(matrix.link(0, 2), 0.05);
  EXPECT_EQ(matrix.link(1, 2), 2);
}

TEST_F(Architectures, WithoutSenseAreRefused) {
  expect_refused("[architecture]\nspeed = 1 0 1\n", 3, "speed");
  expect_refused("[architecture]\nspeed = 1 -1 1\n", 3, "> 0");
  expect_refused("[architecture]\nspeed = 1 1\n", 3, "2 speeds for 3 parts");
  expect_refused("[architecture]\nspeed = 1 nan 1\n", 3, "numbers are wanted");
  expect_refused("[architecture]\nbandwidth = 0\n", 3, "> 0");
  expect_refused("[architecture]\nbandwidth = nowhere.txt\n", 3, "nowhere.txt");
  expect_refused("[architecture]\nlink.0-3 = 1\n", 3, "link.P-Q");
  expect_refused("[architecture]\nlink.1-1 = 1\n", 3, "link.P-Q");
  expect_refused("[architecture]\nsped = 1\n", 3, "did you mean 'speed'");
  expect_refused("[machine]\nspeed = 1\n", 3, "unknown section [machine]");
  expect_refused("", 3, "no section [architecture]");
  EXPECT_THROW(read_architecture(world(), "no-such-file.ini", 2), InputError);
}

TEST_F(Architectures, AProbeWritesWhatAPartitionReads) {
  ProbeOptions options;
  options.seconds = 0.01;
  const MachineProbe probe = probe_machine(world(), options);
  ASSERT_EQ(probe.speed.size(), static_cast<std::size_t>(world().size()));
  for (const Real speed : probe.speed) {
    EXPECT_GT(speed, 0);
    EXPECT_LE(speed, 1);
  }
  const Architecture machine = read(architecture_text(probe), world().size());
  EXPECT_EQ(machine.speed, probe.speed);
  EXPECT_GT(machine.bandwidth, 0);
}

}  // namespace
}  // namespace malleus
