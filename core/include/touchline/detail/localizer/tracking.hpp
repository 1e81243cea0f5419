// SPDX-License-Identifier: Apache-2.0
// The life of a segment's contacts: its states, and which of them may follow which.
// Theory: docs/theory.md, section 6.4.
#pragma once

#include <cstdint>

namespace touchline {

enum class Tracking {
  quiet,      // nothing touches the segment
  suspected,  // something does; no contact is known yet
  pair,       // no single contact explains, from the beginning: two are looked for
  single,     // one contact is known
  several,    // two or more are known
  newcomer,   // the known ones do not explain what is measured
  sliding,    // nor do they, since one of them slides
  ending      // what was not explained has gone, but not for long enough
};
constexpr int kTrackings = 8;  // states

// A transition, and what it takes. `young` and `place_radius` are tuning numbers.
struct Turn {
  Tracking from, to;
  const char* why;
};

constexpr Turn kTurns[] = {
    {Tracking::quiet, Tracking::suspected, "the detector feels a touch"},
    {Tracking::suspected, Tracking::single, "one contact has explained all for `young` / K"},
    {Tracking::suspected, Tracking::pair, "no single contact explains"},
    {Tracking::pair, Tracking::suspected, "a single contact explains after all"},
    {Tracking::pair, Tracking::several, "two places have been told apart for `young` / K"},
    {Tracking::single, Tracking::newcomer, "the innovation is beyond the gate"},
    {Tracking::several, Tracking::newcomer, "the innovation is beyond the gate"},
    {Tracking::several, Tracking::single, "all but one have let go, or two have met"},
    {Tracking::newcomer, Tracking::sliding, "a known contact, moved along its body, explains all"},
    {Tracking::newcomer, Tracking::several, "what is left has had a place for 1 / K: admitted"},
    {Tracking::newcomer, Tracking::ending, "the known ones explain all again"},
    {Tracking::sliding, Tracking::newcomer, "none has explained all by sliding for 1 / K"},
    {Tracking::sliding, Tracking::single, "the only contact is found where it has come to"},
    {Tracking::sliding, Tracking::several, "it has rested where it has come to"},
    {Tracking::sliding, Tracking::ending, "all explain again from where they were"},
    {Tracking::ending, Tracking::newcomer, "they do not explain again"},
    {Tracking::ending, Tracking::single, "that has lasted for 1 / K, and one is known"},
    {Tracking::ending, Tracking::several, "that has lasted for 1 / K, and several are known"},
    {Tracking::suspected, Tracking::quiet, "the detector feels nothing"},
    {Tracking::pair, Tracking::quiet, "the detector feels nothing"},
    {Tracking::single, Tracking::quiet, "the detector feels nothing"},
    {Tracking::several, Tracking::quiet, "the detector feels nothing"},
    {Tracking::newcomer, Tracking::quiet, "the detector feels nothing"},
    {Tracking::sliding, Tracking::quiet, "the detector feels nothing"},
    {Tracking::ending, Tracking::quiet, "the detector feels nothing"},
};

constexpr const char* name_of(Tracking state) {
  constexpr const char* kNames[kTrackings] = {"quiet",   "suspected", "pair",    "single",
                                              "several", "newcomer",  "sliding", "ending"};
  return kNames[static_cast<int>(state)];
}

// The state of one segment. It counts its transitions, so that a test can tell of one that the
// table lacks.
class TrackingState {
 public:
  Tracking now() const { return now_; }
  bool is(Tracking state) const { return now_ == state; }
  void enter(Tracking next) {
    if (next == now_) return;
    ++counts_[static_cast<int>(now_)][static_cast<int>(next)];
    now_ = next;
  }
  std::uint32_t count(Tracking from, Tracking to) const {
    return counts_[static_cast<int>(from)][static_cast<int>(to)];
  }

 private:
  Tracking now_ = Tracking::quiet;
  std::uint32_t counts_[kTrackings][kTrackings] = {};
};

}  // namespace touchline
