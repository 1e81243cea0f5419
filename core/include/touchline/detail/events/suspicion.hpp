// SPDX-License-Identifier: Apache-2.0
// For how long, of a segment, what begins may be a channel that is not what it was.
// Theory: docs/theory.md, section 3.5.
#pragma once

#include <algorithm>

#include "touchline/detail/observer/health.hpp"

namespace touchline {

class Suspicion {
 public:
  // What has begun at `since` or later is doubted until `until` [s].
  void extend(double time, double since, double until) {
    since_ = lasts(time) ? std::min(since_, since) : since;
    until_ = std::max(until_, until);
  }
  bool lasts(double time) const { return time < until_; }
  // Is an event doubted that has begun then [s]?
  bool meets(double time, double began) const { return lasts(time) && began >= since_; }

 private:
  double since_ = 0.0, until_ = -kAbsurd;  // [s]
};

}  // namespace touchline
