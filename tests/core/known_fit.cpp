// SPDX-License-Identifier: Apache-2.0
// Two contacts on one segment of an exported robot that stands. The second has moved along its link, or
// its force has changed, and what is known of both has not. Prints for each such change what known
// contacts say of it: is it explained, with another force, and may one of them have moved?
#include <cstdio>
#include <vector>

#include "touchline/detail/localizer/known_fit.hpp"
#include "touchline/touchline.hpp"

namespace {

using namespace touchline;

constexpr double kForce = 15.0;                        // N, of both
constexpr double kForceKnown = 0.05, kPlaceKnown = 2e-4;  // N, m: sigmas of what is known
constexpr double kAngles[] = {0.3, -0.6, 0.9, -0.4, 0.7, 0.5, 0.2};  // rad, of the joints

// A segment with a six-axis sensor, and two surfaces on different bodies of it.
struct Two {
  int segment = -1, surfaces[2] = {};
};

Two find_two(const Observer& observer, const LinkSurfaces& all) {
  for (int g = 0; g < observer.row_layout().segments; ++g) {
    if (observer.layout().segments[g].sensor < 0 || all.bodies(g).size() < 2) continue;
    const std::vector<Body>& bodies = all.bodies(g);
    return {g, {bodies.front().surfaces.front(), bodies.back().surfaces.front()}};
  }
  return {};
}

KnownContact contact_on(const LinkSurfaces& all, int surface) {
  const SurfaceSample& at = all.samples(surface).front();
  KnownContact k;
  k.surface = surface;
  k.node = all[surface].node;
  k.point = k.alike = at.point;
  k.normal = at.normal;
  k.force = -kForce * all.turn_to_world(at.normal, k.node);
  return k;
}

}  // namespace

int main(int, char** arguments) {
  const Robot robot = read_robot(arguments[1]);
  const Observer observer(Tree(robot.nodes, robot.gravity), robot.joints, robot.sensors);
  const LocalizerSettings settings;
  Measurement measurement(observer, robot.rows, robot.noise, settings);
  const LinkSurfaces surfaces(observer, measurement.posture(), robot.surfaces);
  JointFit fit(measurement.posture(), surfaces, settings, measurement.most_rows());
  KnownFit known(measurement, fit, settings);
  measurement.set_state(kAngles, nullptr, nullptr, nullptr, nullptr);

  const Two two = find_two(observer, surfaces);
  if (two.segment < 0) return 1;
  JointEstimate estimate;
  for (const int surface : two.surfaces) estimate.add(contact_on(surfaces, surface), settings);
  const int n = estimate.size();
  for (int i = 0; i < n; ++i) {
    const double sigma = i % JointEstimate::kEach < 3 ? kForceKnown : kPlaceKnown;
    estimate.covariance[i * (n + 1)] = sigma * sigma;
  }

  // What the sensor shows where the second is `moved` [m] along its link, or pushes by `more` [N].
  const RowLayout& layout = observer.row_layout();
  std::vector<double> row(layout.width(), 0.0);
  row[layout.segment_settled() + two.segment] = 1.0;
  const auto say = [&](const char* what, double size, double moved, double more) {
    double wrench[6] = {};
    for (int c = 0; c < 2; ++c) {
      const KnownContact& k = estimate.known[c];
      Vec3 along, across;
      tangents(k.normal, along, across);
      const double way = c == 1 ? moved : 0.0, times = 1.0 + (c == 1 ? more / kForce : 0.0);
      const Vec3 p = surfaces.to_world(k.point + way * along, k.node), f = times * k.force;
      double one[6];
      store({f, cross(p, f)}, one);
      for (int i = 0; i < 6; ++i) wrench[i] += one[i];
    }
    for (int i = 0; i < 6; ++i) row[layout.segment_wrench() + 6 * two.segment + i] = wrench[i];
    if (!measurement.read(two.segment, row.data(), nullptr)) return;
    fit.weigh(estimate, measurement);
    const bool explained = known.explain(estimate);
    std::printf("%s %g %d %d %d\n", what, size, explained, !known.held(), known.moved());
  };
  say("place", 0.0, 0.0, 0.0);
  for (double way = 5e-4; way < 4e-2; way += 5e-4) say("place", way, way, 0.0);
  for (double more = 0.02; more < 4.0; more += 0.02) say("force", more, 0.0, more);
  return 0;
}
