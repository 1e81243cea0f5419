// SPDX-License-Identifier: Apache-2.0
// From what the localizer says to a contact for the user.
// Theory: docs/theory.md, section 7.3.
#pragma once

#include <algorithm>
#include <cmath>

#include "touchline/detail/localizer/localizer.hpp"
#include "touchline/result.hpp"

namespace touchline {

// Fills what an answer tells of a contact on segment g: all but event, class, zone and wrench.
inline void describe(const Answer& answer, int g, Contact& c) {
  const bool is_placed = placed(answer);
  c.segment = g;
  c.status = answer.status == Status::none ? Status::wrench_only : answer.status;
  c.link = is_placed ? answer.candidates[0].surface : -1;
  c.body_probability = is_placed ? answer.body_probability : kUnknown;
  c.position = is_placed ? answer.candidates[0].point : kNowhere;
  const bool finite = std::isfinite(answer.force.x) && std::isfinite(answer.force.y) &&
                      std::isfinite(answer.force.z);
  c.force = is_placed || finite ? answer.force : kNowhere;
  for (int i = 0; i < 9; ++i) c.covariance[i] = is_placed ? answer.covariance[i] : kUnknown;
  c.candidates.count = std::min(answer.count, Candidates::kMost);
  for (int i = 0; i < c.candidates.count; ++i) {
    const Candidate& k = answer.candidates[i];
    c.candidates.of[i] = {k.surface, k.weight, k.point, k.radius};
  }
  c.rank = answer.rank > 0 ? answer.rank : -1;
  c.unknowns = answer.unknowns > 0 ? answer.unknowns : -1;
  c.searching = answer.searching;
  const bool explained = answer.count > 0;
  c.pitch = explained ? answer.pitch : kUnknown;
  c.chi2 = explained ? answer.chi2 : kUnknown;
  c.degrees = explained ? answer.degrees : -1;
}

// Of two explanations, a contact and a faulty channel or an error of the model, none is preferred.
constexpr double kDoubted = 0.5;

// What is said of a contact or an event that may be none.
template <class T>
void halve(T& said) {
  if (said.status == Status::located) said.status = Status::ambiguous;
  said.body_probability *= kDoubted;
  for (int i = 0; i < said.candidates.count; ++i) said.candidates.of[i].probability *= kDoubted;
}
inline void doubt(Contact& contact) { halve(contact); }
inline void doubt(Event& event) {
  if (!event.doubted) halve(event);
  event.doubted = true;
}

}  // namespace touchline
