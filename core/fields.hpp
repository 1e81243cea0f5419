// SPDX-License-Identifier: Apache-2.0
// The fields of contacts and events for Python: a table of them, and their values as numbers.
#pragma once

#include <nanobind/nanobind.h>

#include <cstddef>
#include <vector>

#include "touchline/result.hpp"

namespace touchline::fields {

namespace nb = nanobind;
namespace tl = touchline;

// Numbers that a value of this type takes.
template <class T>
std::size_t width() {
  static const std::size_t count = [] {
    std::vector<double> room(1024);
    return static_cast<std::size_t>(tl::write_numbers(T{}, room.data()) - room.data());
  }();
  return count;
}

inline const char* name(tl::FieldKind kind) {
  switch (kind) {
    case tl::FieldKind::number: return "number";
    case tl::FieldKind::count: return "count";
    case tl::FieldKind::flag: return "flag";
    case tl::FieldKind::vector: return "vector";
    case tl::FieldKind::segment: return "segment";
    case tl::FieldKind::joint: return "joint";
    case tl::FieldKind::link: return "link";
    case tl::FieldKind::body: return "body";
    case tl::FieldKind::level: return "level";
    case tl::FieldKind::status: return "status";
    case tl::FieldKind::zone: return "zone";
    case tl::FieldKind::candidates: return "candidates";
  }
  return "";
}

// Of each field: name, kind, columns, where its numbers begin and how many they are.
template <class T>
nb::list table() {
  nb::list rows;
  std::vector<double> room(1024);
  double* at = room.data();
  tl::visit_fields(T{}, [&](const tl::Field& field, const auto& value) {
    tl::FieldNumbers numbers(at);
    numbers(field, value);
    rows.append(nb::make_tuple(field.name, name(field.kind), field.columns, at - room.data(),
                               numbers.end() - at));
    at = numbers.end();
  });
  return rows;
}

// In the order of `touchline::Status`.
constexpr const char* kStatuses[] = {"none", "located", "ambiguous", "not_separable", "wrench_only"};

inline void bind(nb::module_& m) {
  m.attr("CONTACT_FIELDS") = nb::tuple(table<tl::Contact>());
  m.attr("EVENT_FIELDS") = nb::tuple(table<tl::Event>());
  m.attr("CANDIDATE_WIDTH") = tl::FieldNumbers::kOfCandidate;
  m.attr("STATUSES") = nb::make_tuple(kStatuses[0], kStatuses[1], kStatuses[2], kStatuses[3], kStatuses[4]);
  m.attr("CONTACT_LEVELS") = nb::make_tuple("contact", "collision");
  m.attr("ZONES") = nb::make_tuple("structure", "end_effector", "handle", "open");
}

}  // namespace touchline::fields
