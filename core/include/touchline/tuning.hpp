// SPDX-License-Identifier: Apache-2.0
// What a user may choose about the estimation; what belongs to a robot stands in robot.hpp. Every
// number that is neither physics nor the robot's own is a member here, by module:
// docs/reference/tuning.md.
#pragma once

#include "touchline/detail/classifier/tuning.hpp"
#include "touchline/detail/detector/tuning.hpp"
#include "touchline/detail/events/tuning.hpp"
#include "touchline/detail/gates/tuning.hpp"
#include "touchline/detail/localizer/tuning.hpp"
#include "touchline/detail/observer/channels.hpp"
#include "touchline/detail/observer/tuning.hpp"
#include "touchline/detail/place/tuning.hpp"

namespace touchline {

struct Tuning {
  Method method = Method::segment;  // of the observer
  Discretization discretization = Discretization::automatic;
  bool first_entry = false;  // the paper's rule for places: the first link that the line enters
  GatesTuning gates;
  ObserverTuning observer;
  DetectorTuning detector;
  PlaceTuning place;          // of one contact at one instant
  LocalizerTuning localizer;  // of contacts over time
  ClassifierTuning classifier;
  EventsTuning events;

  // Calls `v(module, name, unit, number)` for each number; a unit of "1" is none.
  template <class Self, class Visit>
  static void visit(Self& t, Visit&& v) {
    const auto in = [&v](const char* module) {
      return [&v, module](const char* name, const char* unit, auto& number) {
        v(module, name, unit, number);
      };
    };
    GatesTuning::visit(t.gates, in("gates"));
    ObserverTuning::visit(t.observer, in("observer"));
    DetectorTuning::visit(t.detector, in("detector"));
    PlaceTuning::visit(t.place, in("place"));
    LocalizerTuning::visit(t.localizer, in("localizer"));
    ClassifierTuning::visit(t.classifier, in("classifier"));
    EventsTuning::visit(t.events, in("events"));
  }
};

}  // namespace touchline
