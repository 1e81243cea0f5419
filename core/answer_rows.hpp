// SPDX-License-Identifier: Apache-2.0
// What the localizer says, as rows of numbers; `touchline.contact.answer` names them.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/classifier/classifier.hpp"
#include "touchline/detail/localizer/localizer.hpp"

namespace answer_rows {

namespace tl = touchline;

// An answer as numbers: status, surface, node, body probability, point, force, covariance, pitch,
// chi2, degrees of freedom, rank, unknowns, number of candidates, then per candidate surface, node,
// probability, point, radius.
constexpr int kHead = 25, kOfCandidate = 7;
constexpr int kWidth = kHead + kOfCandidate * tl::Answer::kCandidates;
constexpr int kPerCandidate = 6;  // of an event: without the radius

inline void write(const tl::Localizer& l, const tl::Answer& a, double* out) {
  std::fill(out, out + kWidth, std::nan(""));
  out[0] = static_cast<double>(a.status);
  out[22] = a.rank;
  out[23] = a.unknowns;
  out[24] = a.count;
  out[1] = out[2] = -1.0;
  const double force[3] = {a.force.x, a.force.y, a.force.z};
  std::copy(force, force + 3, out + 7);
  if (a.count == 0) return;
  const tl::Candidate& best = a.candidates[0];
  out[1] = best.surface;
  out[2] = l.surfaces()[best.surface].node;
  out[3] = a.body_probability;
  const double point[3] = {best.point.x, best.point.y, best.point.z};
  std::copy(point, point + 3, out + 4);
  std::copy(a.covariance, a.covariance + 9, out + 10);
  out[19] = a.pitch;
  out[20] = a.chi2;
  out[21] = a.degrees;
  for (int i = 0; i < a.count; ++i) {
    const tl::Candidate& c = a.candidates[i];
    double* to = out + kHead + kOfCandidate * i;
    const double values[kOfCandidate] = {static_cast<double>(c.surface),
                                         static_cast<double>(l.surfaces()[c.surface].node),
                                         c.weight, c.point.x, c.point.y, c.point.z, c.radius};
    std::copy(values, values + kOfCandidate, to);
  }
}

// What comes before the answer of a contact that is followed: sample, segment, number, its share of
// the segment's load, its kind, whether it is clamped (NaN where that is not known), the rate of the
// segment's force.
constexpr int kClass = 7;

inline void write(const tl::Localizer& l, const tl::Classifier& c, std::size_t i, int g, int k,
                  double* out) {
  const tl::Answer& answer = l.reports()[k].answer;
  const double share = l.reports().share(k);
  const bool open = answer.status == tl::Status::not_separable;
  const double head[kClass] = {static_cast<double>(i),
                               static_cast<double>(g),
                               static_cast<double>(l.reports()[k].serial),
                               share,
                               static_cast<double>(c.kind(g, share)),
                               c.clamped(g, k) ? 1.0 : open ? std::nan("") : 0.0,
                               c.rate(g)};
  std::copy(head, head + kClass, out);
  write(l, answer, out + kClass);
}

// An event as numbers: status, time of the position, variance of the position, number of places,
// the joint positions at that time, then per place surface, node, probability, point in the
// frame of the node; the most probable body's best first.
inline void push_event(tl::Localizer& l, tl::Localizer::Memory& memory, std::vector<double>& out) {
  l.conclude(memory);
  const tl::EventPlace& event = memory.event;
  const std::size_t end = out.size() + 4 + l.joints() + kPerCandidate * tl::EventPlace::kPlaces;
  out.insert(out.end(), {static_cast<double>(l.status(memory)), event.time(), event.variance(),
                         static_cast<double>(event.count())});
  out.insert(out.end(), memory.q.begin(), memory.q.end());
  for (int i = 0; i < event.count(); ++i) {
    const tl::Place& p = event.place(i);
    const tl::LinkSurface& surface = l.surfaces()[p.surface];
    const tl::Vec3 point = surface.mesh.nearest_to_point(p.point).point;
    out.insert(out.end(), {static_cast<double>(p.surface), static_cast<double>(surface.node),
                           p.share, point.x, point.y, point.z});
  }
  out.resize(end, std::nan(""));
}

inline std::size_t event_width(const tl::Localizer& l) {
  return 7 + l.joints() + kPerCandidate * tl::EventPlace::kPlaces;
}

inline void push_event(tl::Localizer& l, std::size_t sample, std::size_t g,
                       tl::Localizer::Memory& memory, std::vector<double>& out) {
  out.insert(out.end(), {static_cast<double>(sample), static_cast<double>(g),
                         static_cast<double>(memory.serial)});
  push_event(l, memory, out);
}

}  // namespace answer_rows
