#include "forge/surface_shape.hpp"

#include <gtest/gtest.h>

#include <cstring>

#include "base/error.hpp"
#include "forge/surface_file.hpp"
#include "shapes.hpp"

namespace malleus::forge {
namespace {

using test::box_surface;
using test::cloud;
using test::sphere_surface;

TEST(ClosestPoint, OnATriangleMatchesADenseSampling) {
  const Vector a(0, 0, 0);
  const Vector b(2, 0.5, 0);
  const Vector c(0.3, 1, 1);
  for (const Vector& point : cloud(40, 3)) {
    const ClosestPoint closest = closest_on_triangle(point, a, b, c);
    Real sampled = 1e300;
    for (int i = 0; i <= 200; ++i) {
      for (int j = 0; i + j <= 200; ++j) {
        const Vector at = a + i / 200.0 * (b - a) + j / 200.0 * (c - a);
        sampled = std::min(sampled, (point - at).squaredNorm());
      }
    }
    EXPECT_LE(closest.squared_distance, sampled + 1e-12);
    EXPECT_NEAR(std::sqrt(closest.squared_distance), std::sqrt(sampled), 1e-2);
    EXPECT_NEAR(closest.weights[0] + closest.weights[1] + closest.weights[2], 1, 1e-14);
  }
}

TEST(ClosestPoint, FlatTrianglesAndSegmentsAreNoTrouble) {
  const Vector a(0, 0, 0);
  EXPECT_NEAR(closest_on_triangle({1, 2, 0}, a, {2, 0, 0}, {1, 0, 0}).squared_distance, 4, 1e-14);
  EXPECT_NEAR(closest_on_triangle({3, 4, 0}, a, a, a).squared_distance, 25, 1e-14);
  EXPECT_NEAR(closest_on_segment({3, 4, 0}, a, a).squared_distance, 25, 1e-14);
}

TEST(FacetTree, FindsWhatASearchOfAllFacetsFinds) {
  const FacetSet set = sphere_surface({0, 0, 0}, 1, 12);
  const FacetTree tree(set);
  for (const Vector& point : cloud(200, 2)) {
    ClosestFacet best;
    std::vector<LocalId> near;
    for (LocalId f = 0; f < set.size(); ++f) {
      const ClosestPoint at = set.closest(f, point);
      if (at.squared_distance < best.at.squared_distance) best = {f, at};
      if (at.squared_distance <= 0.25) near.push_back(f);
    }
    const ClosestFacet found = tree.closest(point, 10);
    EXPECT_EQ(found.facet, best.facet);
    EXPECT_EQ(found.at.squared_distance, best.at.squared_distance);
    EXPECT_EQ(tree.within(point, 0.5), near);
    EXPECT_EQ(tree.closest(point, 0.99 * std::sqrt(best.at.squared_distance)).facet, -1);
  }
}

TEST(Surface, OfABoxIsTheBoxInsideAndOutside) {
  for (const Side side : {Side::outside, Side::inside}) {
    SurfaceReport report;
    const auto surface = make_surface(box_surface({-1, -1, -1}, {1, 1, 1}), side, report);
    const auto box = make_box({0, 0, 0}, {2, 2, 2}, Side::outside);
    EXPECT_TRUE(report.closed);
    EXPECT_FALSE(report.turned);
    for (const Vector& point : cloud(300, 2)) {
      const Real sign = side == Side::outside ? 1 : -1;
      const SurfaceContact expected = box->nearest(point);
      const SurfaceContact found = surface->nearest(point);
      EXPECT_NEAR(found.distance, sign * expected.distance, 1e-12) << point.transpose();
      if (expected.distance > 0) {
        EXPECT_NEAR((found.normal - sign * expected.normal).norm(), 0, 1e-9);
      }
    }
  }
}

TEST(Surface, TurnedInsideOutIsTurnedBack) {
  FacetSet set = box_surface({-1, -1, -1}, {1, 1, 1});
  for (auto& facet : set.facets) std::swap(facet[0], facet[1]);
  SurfaceReport report;
  const auto surface = make_surface(set, Side::outside, report);
  EXPECT_TRUE(report.turned);
  EXPECT_NEAR(surface->nearest({0, 0, 3}).distance, 2, 1e-14);
}

TEST(Surface, CavityHoldsWithAllFacesOfACorner) {
  SurfaceReport report;
  const auto cavity = make_surface(box_surface({-1, -1, -1}, {1, 1, 1}), Side::inside, report);
  std::vector<SurfaceContact> contacts;
  cavity->contacts({0.97, 0.98, -0.99}, 0.1, contacts);
  EXPECT_EQ(contacts.size(), 3U);
  contacts.clear();
  cavity->contacts({0.97, 0.1, 0}, 0.1, contacts);
  ASSERT_EQ(contacts.size(), 1U);
  EXPECT_NEAR(contacts[0].distance, 0.03, 1e-12);
  contacts.clear();
  cavity->contacts({1.02, 1.03, 0}, 0.1, contacts);  // beyond two faces: each pushes back by its own depth
  ASSERT_EQ(contacts.size(), 2U);
  EXPECT_NEAR(std::min(contacts[0].distance, contacts[1].distance), -0.03, 0.02);
}

TEST(Surface, SphereConvergesWithSmoothNormals) {
  for (const int bands : {12, 24}) {
    SurfaceReport report;
    const auto surface = make_surface(sphere_surface({0, 0, 0}, 1, bands), Side::outside, report);
    Real worst_normal = 0;
    Real worst_distance = 0;
    for (Vector point : cloud(200, 1)) {
      point.normalize();
      const SurfaceContact contact = surface->nearest(1.001 * point);
      worst_normal = std::max(worst_normal, (contact.normal - point).norm());
      worst_distance = std::max(worst_distance, std::abs(contact.distance - 0.001));
    }
    EXPECT_LT(worst_normal, 0.45 * std::pow(12.0 / bands, 2) * 0.12);  // second order: facets alone give 0.13 and 0.065
    EXPECT_LT(worst_distance, 0.02 * std::pow(12.0 / bands, 2));
  }
}

TEST(Surface, NormalsHaveNoJumpsOnASmoothPatch) {
  SurfaceReport report;
  const auto surface = make_surface(sphere_surface({0, 0, 0}, 1, 16), Side::outside, report);
  Vector last = surface->nearest({1.0005, 0, 0}).normal;
  for (int i = 1; i <= 2000; ++i) {
    const Real angle = i * 1e-3;
    const Vector normal =
        surface->nearest(1.0005 * Vector(std::cos(angle), 0.3 * std::sin(angle), std::sin(angle)).normalized()).normal;
    EXPECT_LT((normal - last).norm(), 8e-3);
    last = normal;
  }
}

TEST(Surface, PolygonInTheplaneIsSignedByItsTurn) {
  FacetSet square;
  square.dim = 2;
  square.points = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  square.facets = {{0, 1, -1}, {1, 2, -1}, {2, 3, -1}, {3, 0, -1}};
  SurfaceReport report;
  const auto shape = make_surface(square, Side::outside, report);
  EXPECT_TRUE(report.closed);
  EXPECT_NEAR(shape->nearest({0.5, 0.9, 0}).distance, -0.1, 1e-14);
  EXPECT_NEAR(shape->nearest({2, 0.5, 0}).distance, 1, 1e-14);
  EXPECT_NEAR(shape->nearest({4, 5, 0}).distance, 5, 1e-14);
  EXPECT_NEAR((shape->nearest({2, 0.5, 0}).normal - Vector(1, 0, 0)).norm(), 0, 1e-14);
}

TEST(Surface, UnsoundOnesAreRefused) {
  FacetSet set = box_surface({0, 0, 0}, {1, 1, 1});
  std::swap(set.facets[0][0], set.facets[0][1]);
  SurfaceReport report;
  EXPECT_THROW(make_surface(set, Side::outside, report), InputError);
  EXPECT_THROW(make_surface(FacetSet{}, Side::outside, report), InputError);
}

std::string ascii_stl(const FacetSet& set) {
  std::string text = "solid box\n";
  for (LocalId f = 0; f < set.size(); ++f) {
    text += "facet normal 0 0 0\n outer loop\n";
    for (int k = 0; k < 3; ++k) {
      const Vector& p = set.corner(f, k);
      text += "  vertex " + std::to_string(p[0]) + " " + std::to_string(p[1]) + " " + std::to_string(p[2]) + "\n";
    }
    text += " endloop\nendfacet\n";
  }
  return text + "endsolid box\n";
}

std::string binary_stl(const FacetSet& set) {
  std::string bytes(84, ' ');
  const auto count = static_cast<std::uint32_t>(set.size());
  std::memcpy(bytes.data() + 80, &count, 4);
  for (LocalId f = 0; f < set.size(); ++f) {
    std::array<float, 12> values{};
    for (int i = 0; i < 9; ++i)
      values[static_cast<std::size_t>(3 + i)] = static_cast<float>(set.corner(f, i / 3)[i % 3]);
    std::string facet(50, '\0');
    std::memcpy(facet.data(), values.data(), sizeof values);
    bytes += facet;
  }
  return bytes;
}

TEST(Stl, AsciiAndBinaryGiveTheSameClosedSurface) {
  const FacetSet box = box_surface({0, 0, 0}, {100, 50, 25});
  for (const std::string& content : {ascii_stl(box), binary_stl(box)}) {
    const FacetSet read = parse_stl(content, "box.stl", 1e-3);
    EXPECT_EQ(read.points.size(), 8U);
    EXPECT_EQ(read.facets.size(), 12U);
    SurfaceReport report;
    const auto surface = make_surface(read, Side::outside, report);
    EXPECT_TRUE(report.closed);
    EXPECT_NEAR(surface->nearest({0.05, 0.025, 0.035}).distance, 0.01, 1e-9);
  }
}

TEST(Stl, DamagedFilesAreRefusedWithTheirPlace) {
  const std::string whole = ascii_stl(box_surface({0, 0, 0}, {1, 1, 1}));
  const auto message = [](const std::string& content) -> std::string {
    try {
      parse_stl(content, "die.stl", 1);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  std::string broken = whole;
  broken.replace(broken.find("vertex"), 8, "vertex x");
  EXPECT_NE(message(broken).find("die.stl:4:"), std::string::npos) << message(broken);
  EXPECT_NE(message(whole.substr(0, whole.find("endfacet"))).find("die.stl"), std::string::npos);
  EXPECT_NE(message("").find("die.stl"), std::string::npos);
  EXPECT_NE(message(binary_stl(box_surface({0, 0, 0}, {1, 1, 1})).substr(0, 300)).find("die.stl"), std::string::npos);
}

TEST(SurfaceFile, FacetsAreTurnedAlike) {
  FacetSet set = box_surface({0, 0, 0}, {1, 2, 3});
  for (const std::size_t f : {1, 4, 7, 8}) std::swap(set.facets[f][0], set.facets[f][2]);
  turn_alike(set);
  SurfaceReport report;
  const auto shape = make_surface(set, Side::outside, report);
  EXPECT_TRUE(report.closed);
  EXPECT_FALSE(report.turned);
  EXPECT_NEAR(shape->nearest({0.5, 1, 3.5}).distance, 0.5, 1e-14);
  EXPECT_NEAR(shape->nearest({0.5, 1, 2.75}).distance, -0.25, 1e-14);

  FacetSet line;
  line.dim = 2;
  line.points = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}};
  line.facets = {{0, 1, -1}, {2, 1, -1}, {2, 3, -1}};
  turn_alike(line);
  EXPECT_EQ(line.facets[1][0], 1);
  EXPECT_EQ(line.facets[2][0], 2);
}

}  // namespace
}  // namespace malleus::forge
