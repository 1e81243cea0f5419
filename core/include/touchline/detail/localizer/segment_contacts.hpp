// SPDX-License-Identifier: Apache-2.0
// What is remembered of the contacts on one segment from sample to sample: its state, and what
// belongs to each state. What a state has is of use in that state alone; it begins empty.
// Theory: docs/theory.md, section 6.4.
#pragma once

#include <algorithm>
#include <optional>

#include "touchline/detail/localizer/joint_estimate.hpp"
#include "touchline/detail/localizer/tracking.hpp"

namespace touchline {

// A sample of a segment.
struct SegmentSample {
  int segment = 0;
  double bandwidth = 0.0, time = 0.0;  // of the filter [rad/s], [s]
  double lag = 0.0;                    // how old that is which the segment's wrench speaks of [s]

  double brief() const { return 1.0 / bandwidth; }  // the memory of the filter [s]
};

// Contacts at a time before anything new could have been felt.
struct Reference {
  JointEstimate contacts;
  double time = 0.0;
};

// Of all states but quiet.
struct Touched {
  int first = -1;  // number of the contact that stands for the segment while none is known
  Age age;         // of the segment's wrench
  // The last search for a sole contact: when [s], and how many were known then.
  struct Search {
    double time;
    int known;
  };
  std::optional<Search> searched;
  bool two = false;  // have two been looked for?
};

// Suspected: since when one contact has explained all [s], and since when and until when it was not
// clear whether a contact is felt, or one faulty channel [s]. `touched`: a contact explained it throughout.
struct Suspected {
  struct Doubt {
    double since, last;
    bool touched = true;
  };
  std::optional<double> explained;
  std::optional<Doubt> one_channel;
};

// Two that began at the same instant, until they count as known.
struct Together {
  double since = 0.0;                         // one contact has not explained all since [s]
  double seen = 0.0, next_search = 0.0;       // of which time the last outcome speaks, the next search [s]
  bool taken = false, walking = false;        // has the outcome been taken over, and walked on from?
  std::optional<int> second;                  // its number, once it is reported
  bool separable = false;                     // can two places be told apart? Then they are:
  JointEstimate contacts;
  bool walked = false;  // else: is what may be touched all that explains, or a first look at it?
  Answer inseparable;
};

// Single and several, and what they are compared with in the states that follow.
struct Known {
  JointEstimate contacts;
  // Time of the last fit [s]. That which a contact was found by lies ahead: the noise of a filtered
  // sample tells nothing new for 1 / K.
  double updated = 0.0;
  double crept = 0.0;     // up to when the contacts may have crept: their process noise [s]
  Reference now, before;
  std::optional<double> met;  // since when two contacts are one place [s]
};

// One of the known contacts slides, as it is known from where it seems to have come to rest.
struct Slide {
  std::optional<int> slider;   // which of them
  std::optional<double> seen;  // when it was seen to last [s], and where
  Answer place;
  double weighed = 0.0;  // up to when [s] this speaks against each: sum of chi2
  double against[JointEstimate::kMost] = {};
  std::optional<double> rests;  // since when it does [s], and what is known then
  JointEstimate rested;
};

// Newcomer, sliding and ending: something that the known contacts do not explain.
struct Unexplained {
  double since = 0.0;            // [s]
  Age age;                       // of what is left without them
  std::optional<double> placed;  // since when that has a place [s]
  std::optional<int> newcomer;   // its number, once it is reported
  double calm = 0.0;             // ending: since when [s]
  Slide slide;
};

struct SegmentContacts {
  static constexpr int kMost = JointEstimate::kMost;

  TrackingState state;
  Touched touched;
  Suspected suspected;
  Together together;
  Known known;
  Unexplained unexplained;

  // Something touches the segment anew; `first`: the number of that contact. What belongs to later states
  // begins with them; where there are no contacts nothing else of an estimate is read.
  void begin(int first, double time) {
    touched = Touched{};
    suspected = Suspected{};
    together.second.reset();
    together.contacts.count = 0;
    together.separable = together.taken = together.walking = together.walked = false;
    known.contacts.count = 0;
    known.updated = known.crept = 0.0;
    known.now.time = known.before.time = 0.0;
    known.met.reset();
    forget_references();
    unexplained.newcomer.reset();
    touched.first = first;
    touched.age.restart(time);
    state.enter(Tracking::suspected);
  }

  bool unexplained_now() const {
    return state.is(Tracking::newcomer) || state.is(Tracking::sliding) ||
           state.is(Tracking::ending);
  }
  // One contact or several are known, and explain.
  void enter_known() {
    state.enter(known.contacts.count < 2 ? Tracking::single : Tracking::several);
  }

  // Notes what is known, every `interval` [s].
  void refer(double time, double interval) {
    const bool same = known.now.contacts.count == known.contacts.count;
    if (time - known.now.time < interval && same) return;
    if (same) known.before = known.now;
    known.now.contacts = known.contacts;
    known.now.time = time;
    if (known.before.contacts.count != known.contacts.count) known.before = known.now;
  }

  // Without anything to go back to, what is known now must do.
  void refer_at_last(double time) {
    if (known.before.contacts.count == known.contacts.count) return;
    known.before.contacts = known.contacts;
    known.before.time = time;
  }

  // What may have become of the contacts up to an instant.
  void creep(const SegmentSample& now, const LocalizerTuning& t) {
    known.contacts.creep(std::max(0.0, now.time - known.crept), now.bandwidth, t, t.unrest_lasts);
    known.crept = now.time;
  }

  // All that the sample of this instant tells has been taken over.
  void know(const SegmentSample& now) {
    known.updated = now.time + now.brief();
    known.crept = now.time;
    forget_references();
  }

  void forget_references() { known.now.contacts.count = known.before.contacts.count = 0; }
};

}  // namespace touchline
