// SPDX-License-Identifier: Apache-2.0
// Python's `Estimate`, made and read without a detour through Python: that takes longer than a sample.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include <algorithm>
#include <cstddef>
#include <exception>
#include <optional>
#include <string>

#include "arrays.hpp"
#include "guard.hpp"
#include "samples.hpp"
#include "touchline/detail/observer/observer.hpp"

namespace touchline::estimates {

namespace nb = nanobind;
namespace tl = touchline;
using namespace nb::literals;

// The two slots of the class.
struct Slots {
  nb::object rows = nb::steal(PyUnicode_InternFromString("rows"));
  nb::object slices = nb::steal(PyUnicode_InternFromString("_slices"));
};
inline const Slots& slots() {
  static const Slots* const both = new Slots;  // outlives the interpreter
  return *both;
}

// What the class calls a part, which stands in the dict of its slices under that name; and how it is
// read in Python.
struct Part {
  std::string name, doc;
  nb::object key, read;
  std::optional<std::size_t> columns;  // none: it is a whole number
  PyGetSetDef definition;
};

inline nb::object value(const Part& part, nb::handle estimate) {
  const nb::object rows = nb::getattr(estimate, slots().rows);
  const nb::object slices = nb::getattr(estimate, slots().slices);
  PyObject* slice = PyDict_GetItemWithError(slices.ptr(), part.key.ptr());
  if (slice == nullptr) return part.read(estimate);  // which tells what is wrong
  if (part.columns) return arrays::view(rows, slice, *part.columns);
  const bool one = PyArray_Check(rows.ptr()) &&
                   PyArray_NDIM(reinterpret_cast<PyArrayObject*>(rows.ptr())) == 1;
  return one ? nb::steal(PyLong_FromLongLong(arrays::whole(rows, slice))) : part.read(estimate);
}

inline PyObject* read(PyObject* estimate, void* part) noexcept {
  try {
    return value(*static_cast<const Part*>(part), estimate).release().ptr();
  } catch (nb::python_error& error) {
    error.restore();
  } catch (const std::exception& error) {
    PyErr_SetString(PyExc_TypeError, error.what());
  }
  return nullptr;
}

// From now on a property of the class is read here: the columns of its part as a view (`arrays::view`),
// or, without `columns`, the whole number that one sample has there. It keeps its docstring.
inline void read_natively(nb::handle type, const std::string& name,
                          std::optional<std::size_t> columns) {
  const nb::object property = type.attr(name.c_str());
  Part* part = new Part{name, nb::cast<std::string>(nb::str(property.attr("__doc__"))),
                        nb::steal(PyUnicode_InternFromString(name.c_str())), property.attr("fget"),
                        columns, {}};
  part->definition = {part->name.c_str(), &read, nullptr, part->doc.c_str(), part};
  const nb::object descriptor = nb::steal(
      PyDescr_NewGetSet(reinterpret_cast<PyTypeObject*>(type.ptr()), &part->definition));
  if (!descriptor.is_valid()) throw nb::python_error();
  nb::setattr(type, name.c_str(), descriptor);
}

// An observer each of whose updates makes an instance of a class.
struct Estimating {
  guard::Shared<tl::Observer>& observer;
  nb::object type, slices;

  nb::object update(double time, nb::handle q, nb::handle qd, nb::handle tau, nb::handle wrench) {
    tl::Observer& o = observer.value;
    const tl::Sample in = samples::one(o.row_layout(), time, q, qd, tau, wrench);
    arrays::Out out({o.output().size()});
    {
      const guard::Turn turn(observer.turn);
      std::copy_n(o.step(in), o.output().size(), out.data());
    }
    PyTypeObject* of = reinterpret_cast<PyTypeObject*>(type.ptr());
    const nb::object estimate = nb::steal(PyType_GenericAlloc(of, 0));
    if (!estimate.is_valid() ||
        PyObject_SetAttr(estimate.ptr(), slots().rows.ptr(), out.release().ptr()) < 0 ||
        PyObject_SetAttr(estimate.ptr(), slots().slices.ptr(), slices.ptr()) < 0)
      throw nb::python_error();
    return estimate;
  }
};

inline void bind(nb::module_& m) {
  m.def("read_natively", &read_natively, "type"_a, "name"_a, "columns"_a.none(),
        nb::sig("def read_natively(type: type, name: str, columns: int | None) -> None"));
  nb::class_<Estimating>(m, "Estimating")
      .def("__init__",
           [](Estimating* self, guard::Shared<tl::Observer>& observer, nb::object type,
              nb::object slices) { new (self) Estimating{observer, type, slices}; },
           nb::keep_alive<1, 2>(), "observer"_a, "type"_a, "slices"_a,
           nb::sig("def __init__(self, observer: Observer, type: type, slices: dict[str, slice]) -> None"))
      .def("update", &Estimating::update, "time"_a, "q"_a, "qd"_a, "tau"_a, "wrench"_a,
           nb::sig("def update(self, time: float, q: object, qd: object, tau: object, wrench: object) "
                   "-> object"));
}

}  // namespace touchline::estimates
