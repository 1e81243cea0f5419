// SPDX-License-Identifier: Apache-2.0
// The events of whoever speaks, as one line: the whole robot, or a stand-in. Events that last when the
// one hands over to the other wait until that feels them too. An event that both feel is one event.
// Theory: docs/theory.md, section 3.6.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "touchline/detail/events/describe.hpp"
#include "touchline/detail/redundant/channel_doubts.hpp"
#include "touchline/detail/redundant/deputy.hpp"
#include "touchline/detail/redundant/event_numbers.hpp"
#include "touchline/pipeline.hpp"
#include "touchline/result.hpp"

namespace touchline {

class ToldEvents {
 public:
  // All that is handed over stays the caller's. `continues`: for so long events wait [s].
  ToldEvents(Pipeline& whole, const ChannelDoubts& doubts, double continues)
      : whole_(whole),
        doubts_(doubts),
        continues_(continues),
        most_(8 * doubts.segments() * (Reports::kMost + 1)),
        numbers_(most_) {
    changes_.reserve(most_);
    waiting_.reserve(doubts.segments() * (Reports::kMost + 1));
  }

  // A sample begins.
  void begin() { changes_.clear(); }
  // What happened in it.
  Span<EventChange> changes() const { return {changes_.data(), changes_.size()}; }
  // Are all events told as they are by the whole robot itself?
  bool plain() const { return numbers_.empty() && waiting_.empty(); }
  bool renumbers() const { return !numbers_.empty(); }

  int next() const { return std::max(numbers_.next(), whole_.next_event()); }
  void number_from(int next) {
    numbers_.count_from(next);
    whole_.number_events_from(next);
  }

  // Events that have waited for long enough are over.
  void end_those_that_waited() {
    if (waiting_.empty() || whole_.time() < handed_over_ + continues_) return;
    for (Event& event : waiting_) {
      event.cleared = handed_over_;
      if (is_doubted(event)) doubt(event);
      tell(Happened::ended, event);
    }
    waiting_.clear();
  }

  // From now on `to` speaks, which has listened since then [s]; null: the whole robot.
  void hand_over(Deputy* from, Deputy* to, double since) {
    handed_over_ = whole_.time();
    listened_ = since;
    pipeline_of(from).visit_lasting([&](Event event) {
      rename(from, event);
      if (is_doubted(event)) doubt(event);
      if (waiting_.size() < waiting_.capacity()) waiting_.push_back(event);
    });
    numbers_.count_from(next());
    numbers_.forget_all();
    parts_ = to != nullptr ? to : from;
    pipeline_of(to).visit_lasting([&](const Event& event) { begin(to, event); });
    if (to == nullptr) whole_.number_events_from(numbers_.next());
  }

  // What happened in a sample to the events of the one that speaks.
  void take(Deputy* speaker, Span<EventChange> changes) {
    const Pipeline& of = pipeline_of(speaker);
    for (EventChange change : changes) {
      const int own = change.event.id;
      if (change.happened == Happened::began) {
        if (!told(speaker, own)) begin(speaker, change.event);
        continue;
      }
      rename(speaker, change.event);
      tell(change.happened, change.event);
      if (change.happened == Happened::ended) numbers_.forget(of, own);
    }
  }

  // Which of the events that wait do those go on with that have begun? Before contacts ask for numbers.
  void find_continued(Deputy* speaker, Span<EventChange> changes) {
    for (const EventChange& change : changes) {
      const bool news = change.happened == Happened::began;
      if (news && !numbers_.knows(pipeline_of(speaker), change.event.id))
        go_on(speaker, change.event);
    }
  }

  void rename(Deputy* speaker, Contact& contact) {
    const Pipeline& of = pipeline_of(speaker);
    const int own = contact.event;
    numbers_.take_over(of, own, contact);
    contact.event = numbers_.of(of, own, speaker == nullptr);
  }

  // Stand-ins are handed to another pipeline.
  void forget_parts() { parts_ = nullptr; }

  template <class Visit>
  void visit_lasting(Deputy* speaker, Visit&& visit) {
    pipeline_of(speaker).visit_lasting([&](Event event) {
      rename(speaker, event);
      visit(static_cast<const Event&>(event));
    });
    for (const Event& event : waiting_) visit(event);
  }

 private:
  Pipeline& pipeline_of(Deputy* speaker) const {
    return speaker != nullptr ? speaker->pipeline() : whole_;
  }
  static int told_segment(const Deputy* speaker, int own) {
    return speaker != nullptr ? speaker->given().segments[own] : own;
  }

  void rename(Deputy* speaker, Event& event) {
    const Pipeline& of = pipeline_of(speaker);
    const int own = event.id;
    event.id = numbers_.of(of, own, speaker == nullptr);
    event.segment = told_segment(speaker, event.segment);
    numbers_.take_over(of, own, speaker != nullptr, event);
  }

  // An event has begun: is it one of those that wait?
  void begin(Deputy* speaker, Event event) {
    const Pipeline& of = pipeline_of(speaker);
    if (!numbers_.knows(of, event.id)) go_on(speaker, event);
    const bool continues = numbers_.continues(of, event.id);
    rename(speaker, event);
    tell(continues ? Happened::changed : Happened::began, event);
  }

  // The event of `waiting_` that an event goes on with, if any: one on the same link, else one that was
  // told of the same segment, else one of a part of it. A contact that is doubted, and that the one who
  // speaks now has listened for and not felt, is none: a blow that comes then is another.
  void go_on(Deputy* speaker, const Event& own) {
    const int segment = told_segment(speaker, own.segment);
    Event* best = nullptr;
    int most = -1;
    for (Event& event : waiting_) {
      if (event.segment != segment && !same_part(event.segment, segment)) continue;
      const bool unfelt = own.detected > listened_ + whole_.observer().bridge(0);
      if (unfelt && event.doubted && event.level == ContactLevel::contact) continue;
      const bool link = own.link >= 0 && event.link == own.link;
      const int fits = 2 * static_cast<int>(link) + static_cast<int>(event.segment == segment);
      if (fits <= most) continue;
      most = fits;
      best = &event;
    }
    if (best == nullptr || numbers_.full()) return;
    numbers_.go_on(pipeline_of(speaker), own.id, *best);
    *best = waiting_.back();
    waiting_.pop_back();
  }

  // Has this sample's hand-over told of an event?
  bool told(Deputy* speaker, int own) const {
    const int number = numbers_.told(pipeline_of(speaker), own);
    if (number < 0 && speaker != nullptr) return false;
    const int id = number < 0 ? own : number;
    return std::any_of(changes_.begin(), changes_.end(),
                       [id](const EventChange& c) { return c.event.id == id; });
  }

  void tell(Happened happened, const Event& event) {
    if (changes_.size() < changes_.capacity()) changes_.push_back({happened, event});
  }

  // Has an event begun when a channel was not what it was?
  bool is_doubted(const Event& event) const {
    for (std::size_t g = 0; g < doubts_.segments(); ++g) {
      const bool here = static_cast<int>(g) == event.segment ||
                        (parts_ != nullptr && same_part(static_cast<int>(g), event.segment));
      if (here && doubts_.meets(g, whole_.time(), event.detected)) return true;
    }
    return false;
  }

  // Were two segments one for one of those of the last hand-over?
  bool same_part(int g, int h) const { return parts_->told_as(g) == parts_->told_as(h); }

  Pipeline& whole_;
  const ChannelDoubts& doubts_;
  double continues_;
  std::size_t most_;  // changes in a sample, and numbers
  EventNumbers numbers_;
  const Deputy* parts_ = nullptr;  // of the last hand-over: it says which segments are one
  std::vector<Event> waiting_;     // that lasted then, and that the next one has not felt yet
  double handed_over_ = kUnknown;  // [s]
  double listened_ = kUnknown;     // [s]: since when the one that speaks could have felt what waits
  std::vector<EventChange> changes_;
};

}  // namespace touchline
