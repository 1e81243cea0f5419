// SPDX-License-Identifier: Apache-2.0
// Where an event is, from all its strong samples: explanations that agree are one place, fixed on
// its link, and the evidence for each place adds up. Bounded memory, no allocation per sample.
// Theory: docs/theory.md, section 6.6.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/localizer/settings.hpp"
#include "touchline/detail/place/body_share.hpp"
#include "touchline/detail/place/hypothesis.hpp"

namespace touchline {

struct Place {
  int surface = -1;
  Vec3 point;             // in the frame of the node, weighted mean
  double weight = 0.0;    // of the mean: sum of 1 / variance
  double evidence = 0.0;  // log of the odds, before normalization
  double last = 0.0;      // probability in the sample at hand
  double share = 0.0;     // probability of the place
  double radius = 0.0;    // one sigma of a patch that it stands for, 0: a point [m]
  double time = 0.0;      // of the last sample that found it here [s]
  int slot = -1;          // where what belongs to that time is kept; -1: no sample has named it
  bool sure = false;      // was a sample sure of it?
};

class EventPlace {
 public:
  static constexpr int kPlaces = 12;  // room
  // Of the distance within which a sample counts to a place: one that is nearer finds it there. A
  // contact that slides on counts for longer, but has left it.
  static constexpr double kHere = 0.5;

  void restart() { *this = EventPlace{}; }

  // `independence`: how much of an independent sample each one is (K dt / 2 behind a filter).
  // `by_wrench`: is the segment's wrench known? While its sensor is lost joint torques stand in: their
  // errors last, and do not average out. Such samples count only as long as there is no better one.
  // Returns whether the sample is strong; if it is, its explanations are to be added.
  bool begin_sample(double strength, bool by_wrench, double time, double independence,
                    const LocalizerTuning& t) {
    if (by_wrench_ && !by_wrench) return false;
    if (by_wrench != by_wrench_ || t.strong_share * strength > peak_) {  // all that came before was weak
      restart();
      peak_ = strength;
      by_wrench_ = by_wrench;
    }
    peak_ = std::max(peak_, strength);
    if (strength < t.strong_share * peak_) return false;
    time_ = time;
    independence_ = std::min(1.0, independence);
    ++samples_;
    return true;
  }

  // The sample is of one of several contacts, which are followed: each sample speaks of all before it.
  void follow() { followed_ = true; }

  // Explanations of a sample that no single force explains count only as long as there is no other.
  bool open(int status, bool explained) {
    ++statuses_[status];
    if (!explained) ++unexplained_;
    if (!explained && explained_ > 0) return false;
    if (explained && explained_ == 0) {
      count_ = 0;
      missed_ = 0.0;
    }
    for (int i = 0; i < count_; ++i) places_[i].last = 0.0;
    return true;
  }

  // `sure`: the sample is sure of it. Returns the slot for what belongs to its time; -1: it is not there.
  int add(int surface, const Vec3& point, double probability, double variance, bool sure,
          const LocalizerSettings& t) {
    if (!(variance > 0.0) || probability < t.floor) return -1;
    const double near = std::max(t.place_radius, t.agree_sigmas * std::sqrt(variance));
    Place* place = nullptr;
    double least = near;
    for (int i = 0; i < count_; ++i) {
      const double distance = norm(places_[i].point - point);
      if (places_[i].surface == surface && distance < least) {
        least = distance;
        place = &places_[i];
      }
    }
    if (place == nullptr) place = fresh(surface);
    const double weight = probability / (variance + t.smoothness);
    place->weight += weight;
    place->point = place->point + (weight / place->weight) * (point - place->point);
    place->last += probability;
    place->sure = place->sure || sure;
    if (norm(place->point - point) > kHere * near) return -1;
    place->time = time_;
    return place->slot;
  }

  // `variance` of the sample's best place, of which the part `lasting` is that of the next as well.
  void close(double variance, double lasting, const LocalizerTuning& t) {
    for (int i = 0; i < count_; ++i)
      places_[i].evidence += independence_ * std::log(std::clamp(places_[i].last, t.floor, 1.0));
    missed_ += independence_ * std::log(t.floor);
    if (std::isfinite(variance)) {
      variance_ += (1.0 - lasting) * variance;
      lasting_ += lasting * variance;
      ++explained_;
    }
  }

  // Gives each place its probability and sorts them: the most probable body's best comes first,
  // the others by probability. `body(surface)` tells what is one body.
  template <class Body>
  void conclude(Body&& body, const LocalizerTuning& t) {
    const double looks = independent(t);
    double sum = 0.0, most = -1e300;
    for (int i = 0; i < count_; ++i) most = std::max(most, places_[i].evidence);
    for (int i = 0; i < count_; ++i) sum += std::exp(looks * (places_[i].evidence - most));
    for (int i = 0; i < count_; ++i)
      places_[i].share = std::exp(looks * (places_[i].evidence - most)) / sum;
    lead(body);
  }

  // Gives each body the probability that the evidence for links gives it; where no sample has named
  // it, its best patch stands for it. `body(surface)` is the node of a surface.
  template <class Body>
  void share_out(const std::vector<BodyShare>& shares, Body&& body, const LocalizerTuning& t) {
    for (const BodyShare& of : shares) {
      double here = 0.0;
      for (int i = 0; i < count_; ++i) here += body(places_[i].surface) == of.node ? places_[i].share : 0.0;
      for (int i = 0; i < count_; ++i) {
        if (body(places_[i].surface) == of.node) places_[i].share *= of.share / here;
      }
      if (here > 0.0 || of.share < t.floor) continue;
      Place& place = count_ < kPlaces ? places_[count_++] : *least_likely();
      place = Place{};
      place.surface = of.surface;
      place.point = of.point;
      place.radius = of.radius;
      place.share = of.share;
    }
    lead(body);
  }

  int count() const { return count_; }
  const Place& place(int i) const { return places_[i]; }
  // Of the most probable place; -1: no sample has named it.
  int slot() const { return count_ > 0 ? places_[0].slot : -1; }
  // At which it was found there last [s].
  double time() const { return slot() >= 0 ? places_[0].time : time_; }
  // May the most probable place be sure? Of a contact that is followed only if a sample was sure of it:
  // what they say in common does not add up.
  bool may_be_sure() const { return !followed_ || places_[0].sure; }
  bool mostly_unexplained() const { return 2 * unexplained_ > samples_; }
  int frequent(int a, int b) const { return statuses_[a] >= statuses_[b] ? a : b; }

  // Of the mean over the event, which takes away only what differs from sample to sample.
  double variance() const {
    if (count_ > 0 && places_[0].radius > 0.0) return 2.0 * places_[0].radius * places_[0].radius;
    if (explained_ == 0) return std::nan("");
    const double looks = 1.0 + (explained_ - 1) * independence_;
    return (variance_ / looks + lasting_) / explained_;
  }

 private:
  // How much of the evidence of all samples counts. What errs in one, the model, errs in the next: they
  // are not that many looks. Of `all` looks with the part `same` of their variance in common the mean
  // is worth all / (1 + (all - 1) same).
  double independent(const LocalizerTuning& t) const {
    const double all = missed_ / std::log(t.floor), sum = variance_ + lasting_;
    if (!(all > 1.0)) return 1.0;
    const double same = sum > 0.0 ? lasting_ / sum : 0.0;
    return std::min(t.looks / all, 1.0 / (1.0 + (all - 1.0) * same));
  }

  // Sorts by probability, but that the most probable body's best place comes first.
  template <class Body>
  void lead(Body&& body) {
    std::sort(places_, places_ + count_,
              [](const Place& a, const Place& b) { return a.share > b.share; });
    int first = 0;
    double largest = 0.0;
    for (int i = 0; i < count_; ++i) {
      double of_body = 0.0;
      for (int k = 0; k < count_; ++k)
        of_body += body(places_[i].surface) == body(places_[k].surface) ? places_[k].share : 0.0;
      if (of_body > largest + 1e-12) {
        largest = of_body;
        first = i;
      }
    }
    std::rotate(places_, places_ + first, places_ + std::min(first + 1, count_));
  }

  Place* least_likely() {
    return std::min_element(places_, places_ + count_,
                            [](const Place& a, const Place& b) { return a.share < b.share; });
  }

  Place* fresh(int surface) {
    Place* place = places_;
    int slot = count_;
    if (count_ < kPlaces) {
      place = &places_[count_++];
    } else {
      place = std::min_element(places_, places_ + kPlaces, [](const Place& a, const Place& b) {
        return a.evidence < b.evidence;
      });
      slot = place->slot;
    }
    *place = Place{};
    place->surface = surface;
    place->evidence = missed_;
    place->slot = slot;
    return place;
  }

  Place places_[kPlaces];
  int count_ = 0, samples_ = 0, explained_ = 0, unexplained_ = 0;
  int statuses_[5] = {};
  double peak_ = 0.0, time_ = 0.0, independence_ = 1.0, missed_ = 0.0;
  bool followed_ = false, by_wrench_ = false;
  double variance_ = 0.0, lasting_ = 0.0;  // sums over the explained samples
};

}  // namespace touchline
