// SPDX-License-Identifier: Apache-2.0
// What stands on each row and is no touch: the baseline, which follows slowly and not far. The mean of
// the last moments may come to rest as an offset; what stood there before that is remembered. All rows
// side by side. No allocation after construction.
// Theory: docs/theory.md, section 4.7.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/detector/row_lanes.hpp"
#include "touchline/detail/detector/rows.hpp"
#include "touchline/detail/detector/tuning.hpp"

namespace touchline {

// What may stand on a row while nothing touches [N or Nm].
struct Calm {
  double baseline = 0.0, anchor = 0.0, shown = 0.0;  // as of `RowOffsets`
};

class RowOffsets {
 public:
  // All that is handed over stays the caller's. `longest`: time constant of the baselines [s].
  RowOffsets(const DetectorRows& rows, double longest, const DetectorTuning& tuning)
      : rows_(rows),
        tuning_(tuning),
        longest_(longest),
        per_trend_(1.0 / tuning.trend),
        per_fro_memory_(1.0 / tuning.fro_memory),
        baseline_limits_(rows.size()),
        bandwidths_(rows.size()),
        confirmed_at_(rows.size()),
        settled_at_(rows.size()),
        baseline_(rows.size()),
        reference_(rows.size()),
        origin_(rows.size()),
        anchor_(rows.size()),
        shown_(rows.size()),
        seconds_(rows.size()),
        trend_(rows.size()),
        age_(rows.size()),
        referred_(rows.size()),
        side_(rows.size(), 1.0),
        turns_(rows.size()),
        known_(rows.size()),
        crossed_(rows.size()),
        before_(rows.size()),
        started_(rows.size(), 0),
        quiet_(rows.segments(), 0.0),
        quiet_before_(rows.segments(), 0.0) {
    for (std::size_t i = 0; i < rows.size(); ++i) {
      baseline_limits_[i] = rows[i].baseline_limit;
      bandwidths_[i] = rows.bandwidths[i];
      confirmed_at_[i] = tuning.confirm / rows.bandwidths[i];
      settled_at_[i] = tuning.trend / rows.bandwidths[i];
    }
  }

  double baseline(std::size_t i) const { return baseline_[i]; }    // [N or Nm]
  double trend(std::size_t i) const { return trend_[i]; }          // mean of the last moments [N or Nm]
  const RowLanes& trends() const { return trend_; }
  double reference(std::size_t i) const { return reference_[i]; }  // the quick baseline [N or Nm]
  double referred(std::size_t i) const { return referred_[i]; }    // over how long it is averaged [s]
  // What stood there at the start, or rests there since a contact, with what it has drifted by since.
  double anchor(std::size_t i) const { return anchor_[i]; }        // [N or Nm]
  double shown(std::size_t i) const { return shown_[i]; }          // the largest of these so far
  double age(std::size_t i) const { return age_[i]; }  // over how long the baseline is averaged [s]
  bool started(std::size_t i) const { return started_[i] != 0; }  // was it ever known?
  // Per segment: over how long its baseline has been averaged [s].
  const std::vector<double>& quiet() const { return quiet_; }

  // What stands on row i when observation begins is an offset.
  void begin(std::size_t i, double at) {
    baseline_[i] = anchor_[i] = origin_[i] = reference_[i] = trend_[i] = at;
    started_[i] = 1;
  }

  // Row i goes on for row `of` of another arm's offsets, which here stands at `at`.
  void go_on_from(const RowOffsets& other, std::size_t of, std::size_t i, double at) {
    const double way = at - other.baseline_[of];
    for (RowLanes RowOffsets::* member :
         {&RowOffsets::baseline_, &RowOffsets::reference_, &RowOffsets::origin_, &RowOffsets::anchor_,
          &RowOffsets::shown_, &RowOffsets::seconds_, &RowOffsets::age_, &RowOffsets::referred_,
          &RowOffsets::side_, &RowOffsets::turns_, &RowOffsets::known_})
      (this->*member)[i] = (other.*member)[of];
    for (RowLanes RowOffsets::* member : {&RowOffsets::baseline_, &RowOffsets::anchor_,
                                          &RowOffsets::origin_, &RowOffsets::reference_})
      (this->*member)[i] += way;
    before_[i] = other.before_[of];
    before_[i].baseline += way;
    before_[i].anchor += way;
    started_[i] = other.started_[of];
    trend_[i] = at;
  }

  // By how much a row has changed within the last moments, and what motions change it by at most in them
  // [N or Nm]. One that is known anew has no last moments: its mean is of before it was lost.
  double quick(std::size_t i) const {
    return is_anew(i) ? 0.0 : std::fabs(rows_.samples[i].residual - trend_[i]);
  }
  double creep(std::size_t i) const { return tuning_.creep_share * std::fabs(lasting(i)); }
  bool is_anew(std::size_t i) const { return !(known_[i] > 0.0); }
  // What the last moments have beyond the baseline [N or Nm].
  double lasting(std::size_t i) const { return trend_[i] - baseline_[i]; }

  // Does more than a threshold stand on a row of an arm that has shown that it is not as told?
  bool stands_off(std::size_t i) const {
    return std::min(std::fabs(anchor_[i]), shown_[i]) > rows_[i].contact;
  }
  // By how much has what stands on a row drifted: 0 for less than a threshold [N or Nm].
  double warmed(std::size_t i) const {
    const double drift = anchor_[i] - origin_[i];
    return std::fabs(drift) > rows_[i].contact ? drift : 0.0;
  }

  // What the last moments have of a row is an offset from now on.
  void rest(std::size_t i) {
    const double trend = trend_[i];
    baseline_[i] = anchor_[i] = origin_[i] = reference_[i] = trend;
    shown_[i] = std::max(shown_[i], std::fabs(trend));
    age_[i] = referred_[i] = settled_at_[i];
  }

  // What is left of a contact and does not change rests there: an offset from now on. What stood
  // there before is remembered, unless what is remembered stood there for longer. A row that is not
  // known has no last moments: what stands there is not seen.
  void come_to_rest(std::size_t g) {
    const bool longer = quiet_[g] > quiet_before_[g];
    if (longer) quiet_before_[g] = quiet_[g];
    for (const std::size_t i : rows_.of(g)) {
      if (longer) before_[i] = {baseline_[i], anchor_[i], shown_[i]};
      if (!is_anew(i)) rest(i);
    }
    quiet_[g] = tuning_.trend / rows_.slowest(g);
  }

  // Is all of the segment as it was before the offset that stands there now, within this part of its
  // limits? That was a contact then, of which nothing is left: one that was held, or there when
  // observation began.
  bool is_back(std::size_t g, double part) const {
    for (const std::size_t i : rows_.of(g)) {
      const double most = part * rows_.limits[i] * rows_[i].contact;
      if (!rows_.samples[i].known || std::fabs(trend_[i] - before_[i].baseline) > most) return false;
    }
    return true;
  }
  void go_back(std::size_t g) {
    for (const std::size_t i : rows_.of(g)) {
      rest(i);
      anchor_[i] = origin_[i] = before_[i].anchor;
      shown_[i] = before_[i].shown;
    }
    quiet_[g] = tuning_.trend / rows_.slowest(g);
  }

  // The means of the last moments and the references: these of rows that may `adapt`. Noise is measured
  // where it `counts`, and where it goes to and fro more often within the filter's memory than a hand can.
  // Returns whether what stood at the start of a row is to be confirmed: `is_to_confirm` tells of which.
  bool follow_trends(const RowLanes& adapt, RowLanes& counts, double dt) {
    const Lanes zero = all_lanes(0.0), one = all_lanes(1.0);
    Lanes any = zero;
    for (std::size_t i = 0; i < known_.size(); i += kLanes) {
      const Lanes known = rows_.known.at(i), value = rows_.residuals.at(i),
                  bandwidth = bandwidths_.at(i);
      const Lanes before = trend_.at(i);
      const Lanes from = known_.at(i) > zero ? before : value;
      const Lanes part = dt * bandwidth * per_trend_;
      const Lanes trend = from + (value - from) * (part < one ? part : one);
      trend_.put(i, known > zero ? trend : before);
      known_.put(i, known);
      const Lanes seconds = seconds_.at(i), later = seconds + dt, end = confirmed_at_.at(i);
      Lanes crossed = seconds < end ? one : zero;
      crossed = later < end ? zero : crossed;
      crossed = known > zero ? crossed : zero;
      crossed_.put(i, crossed);
      any = any + crossed;
      seconds_.put(i, known > zero ? later : seconds);
      // Running means first, low-passes once they have seen enough.
      const Lanes adapts = known * adapt.at(i), most = all_lanes(tuning_.reference);
      const Lanes referred = referred_.at(i), more = referred + dt;
      const Lanes span = most < more ? most : more, share = dt / span;
      const Lanes reference = reference_.at(i);
      const Lanes moved = reference + (value - reference) * (share < one ? share : one);
      referred_.put(i, adapts > zero ? span : referred);
      const Lanes followed = span > zero ? moved : reference;
      reference_.put(i, adapts > zero ? followed : reference);
      if (dt > 0.0) follow_turns(i, value - trend, dt * bandwidth * per_fro_memory_, counts);
    }
    return any_above_zero(any);
  }

  bool is_to_confirm(std::size_t i) const { return crossed_[i] > 0.0; }
  // What stood there at the first sample may be a rest of settling, or of an arm that is set going.
  // It shows that the arm is not as told only if it still stands there a while later. Returns what
  // does, or 0 [N or Nm].
  double confirm(std::size_t i) {
    const double trend = trend_[i], anchor = anchor_[i];
    const double least = std::min(std::fabs(trend), std::fabs(anchor));
    const double most = std::max(std::fabs(trend), std::fabs(anchor));
    if (!(trend * anchor > 0.0 && most < tuning_.alike * least)) return 0.0;
    shown_[i] = std::max(shown_[i], least);
    return least > rows_[i].contact ? std::copysign(least, anchor) : 0.0;
  }

  // The baselines of the rows that are averaged, and what stands there; `shown`: what motion alone
  // shows [N or Nm]. Returns whether that is more than a threshold, or has drifted by more, on any row.
  bool follow_baselines(const RowLanes& averaged, const RowLanes& shown, double dt) {
    const Lanes zero = all_lanes(0.0), one = all_lanes(1.0);
    const Lanes longest = all_lanes(longest_);
    const double warming = std::min(1.0, dt / tuning_.warming);
    Lanes off = zero;
    for (std::size_t i = 0; i < known_.size(); i += kLanes) {
      const Lanes averages = averaged.at(i), value = rows_.residuals.at(i), contact = rows_.contact.at(i);
      const Lanes age = age_.at(i), older = age + dt, tau = longest < older ? longest : older;
      age_.put(i, averages > zero ? older : age);
      const Lanes baseline = baseline_.at(i), anchor = anchor_.at(i), origin = origin_.at(i);
      const Lanes part = dt / tau;
      const Lanes next = baseline + (value - baseline) * (part < one ? part : one);
      const Lanes told = baseline_limits_.at(i), moved = shown.at(i);
      const Lanes most = told < moved ? moved : told;
      const Lanes now = within(next, anchor - most, anchor + most);
      // No hand rises as slowly as a sensor warms up.
      const Lanes farthest = tuning_.warming_most * contact;
      const Lanes warmed =
          within(anchor + (now - anchor) * warming, origin - farthest, origin + farthest);
      const Lanes settling = settled_at_.at(i);
      const Lanes does = tau > zero ? averages : zero;
      const Lanes next_anchor = older < settling ? now : warmed;
      const Lanes next_origin = older < settling ? now : origin;
      const Lanes stands = does > zero ? next_anchor : anchor;
      const Lanes began = does > zero ? next_origin : origin;
      baseline_.put(i, does > zero ? now : baseline);
      anchor_.put(i, stands);
      origin_.put(i, began);
      const Lanes size = larger(stands, -stands), most_shown = shown_.at(i);
      const Lanes least = most_shown < size ? most_shown : size, drift = stands - began;
      off = off + (least > contact ? one : zero) + (larger(drift, -drift) > contact ? one : zero);
    }
    follow_quiet(averaged);
    return any_above_zero(off);
  }

  // The part that the present sample is of a row's baseline; `averaged` as it was then.
  double share(std::size_t i, double dt) const {
    const double tau = std::min(age_[i], longest_);
    return tau > 0.0 ? std::min(1.0, dt / tau) : 0.0;
  }

 private:
  // Of rows from i on, that are off their trends by so much; `forgets`: what part of their turns.
  void follow_turns(std::size_t i, const Lanes& off, const Lanes& forgets, RowLanes& counts) {
    const Lanes zero = all_lanes(0.0), one = all_lanes(1.0);
    const Lanes known = rows_.known.at(i), side = side_.at(i), turns = turns_.at(i);
    const Lanes most = tuning_.fro * rows_.limits.at(i) * rows_.contact.at(i);
    const Lanes keep = one - forgets, on = off * side;
    const Lanes more = off > zero ? one : -one;
    Lanes now = turns * (zero < keep ? keep : zero);
    now = now + (on < -most ? one : zero);
    Lanes next = off > most ? more : side;
    next = off < -most ? more : next;
    turns_.put(i, known > zero ? now : turns);
    side_.put(i, known > zero ? next : side);
    const Lanes usual = counts.at(i);
    counts.put(i, now > all_lanes(tuning_.fro_turns) ? one : usual);
  }

  // The last of a segment's rows that are averaged stands for it.
  void follow_quiet(const RowLanes& averaged) {
    for (std::size_t g = 0; g < quiet_.size(); ++g) {
      std::size_t i = rows_.end(g);
      while (i > rows_.first(g) && !(averaged[i - 1] > 0.0)) --i;
      if (i > rows_.first(g)) quiet_[g] = age_[i - 1];
    }
  }

  static Lanes within(const Lanes& x, const Lanes& low, const Lanes& high) {
    const Lanes below = high < x ? high : x;
    return x < low ? low : below;
  }
  static bool any_above_zero(const Lanes& x) {
    for (int k = 0; k < kLanes; ++k)
      if (lane(x, k) > 0.0) return true;
    return false;
  }

  const DetectorRows& rows_;
  const DetectorTuning& tuning_;
  double longest_;
  double per_trend_, per_fro_memory_;  // inverse: divisions per row and sample are dear
  // Of the robot: how far baselines may go [N or Nm]; bandwidths [rad/s]; when the start is confirmed,
  // until when what stands there is averaged [s].
  RowLanes baseline_limits_, bandwidths_, confirmed_at_, settled_at_;
  RowLanes baseline_, reference_;
  RowLanes origin_;  // what stood there at the start, or rests there since a contact
  RowLanes anchor_, shown_;
  RowLanes seconds_;  // since the first settled sample
  RowLanes trend_;
  RowLanes age_, referred_;
  RowLanes side_, turns_;  // of its trend it was last far off on, and how often of late
  RowLanes known_;         // 1: at the last sample, else 0
  RowLanes crossed_;       // 1: what stood at the start is to be confirmed at this sample
  // What stood there before the last contact came to rest; the model's zero at first.
  std::vector<Calm> before_;
  std::vector<char> started_;  // was there a settled residual ever?
  // Per segment: over how long its baseline, and what is remembered of it, has been averaged [s].
  std::vector<double> quiet_, quiet_before_;
};

}  // namespace touchline
