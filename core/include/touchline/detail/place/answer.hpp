// SPDX-License-Identifier: Apache-2.0
// What is said of the contact on one segment at one instant.
// Theory: docs/theory.md, section 5.7.
#pragma once

#include "touchline/detail/place/view.hpp"

namespace touchline {

enum class Status { none = 0, located = 1, ambiguous = 2, not_separable = 3, wrench_only = 4 };

struct Answer {
  static constexpr int kCandidates = 12;  // room
  Status status = Status::none;
  int count = 0;                      // of candidates
  Candidate candidates[kCandidates];  // the most probable body's best first
  double body_probability = 0.0;
  Vec3 force;
  double covariance[9] = {};  // of the first candidate's point
  double spread = 0.0;        // root of its trace
  double lasting = 0.0;       // part of it (squared) that the next samples have in common
  double pitch = 0.0;         // in standard deviations
  double chi2 = 0.0;
  int degrees = 0;  // of freedom of chi2
  // Where no equation is left over, for one contact or for several that began together: how many
  // there are, and unknowns, five of each contact.
  int rank = 0, unknowns = 0;
  bool searching = false;  // does a search for places still run, that will say more?
};

}  // namespace touchline
