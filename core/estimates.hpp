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
#include <tuple>
#include <utility>

#include "arrays.hpp"
#include "at_once.hpp"
#include "guard.hpp"
#include "samples.hpp"
#include "touchline/detail/observer/observer.hpp"

namespace touchline::estimates {

namespace nb = nanobind;
namespace tl = touchline;
using namespace nb::literals;

// The base of the class. The numbers of one sample stand in the object itself; those of N, or those
// that Python gives, in an array.
struct Rows {
  PyVarObject head;
  PyObject* rows;    // the array; null: the numbers follow
  PyObject* slices;  // by the name of a part: a dict
  double numbers[1];

  std::size_t count() const { return static_cast<std::size_t>(head.ob_size); }
};

inline void destroy(PyObject* self) noexcept {
  PyTypeObject* type = Py_TYPE(self);
  Rows* of = reinterpret_cast<Rows*>(self);
  Py_XDECREF(of->rows);
  Py_XDECREF(of->slices);
  reinterpret_cast<freefunc>(PyType_GetSlot(type, Py_tp_free))(self);
  Py_DECREF(reinterpret_cast<PyObject*>(type));
}

// The numbers of `self` from `first` on, `count` of them, as a view; see `arrays::view`.
inline nb::object shown(Rows* self, std::size_t first, std::size_t count, std::size_t columns) {
  npy_intp dims[2] = {static_cast<npy_intp>(columns > 0 ? count / columns : count),
                      static_cast<npy_intp>(columns)};
  return arrays::shown(reinterpret_cast<PyObject*>(self), columns > 0 ? 2 : 1, dims, nullptr,
                       self->numbers + first, NPY_ARRAY_WRITEABLE);
}

inline PyObject* get_rows(PyObject* self, void*) noexcept {
  Rows* of = reinterpret_cast<Rows*>(self);
  if (of->rows != nullptr) return Py_INCREF(of->rows), of->rows;
  try {
    return shown(of, 0, of->count(), 0).release().ptr();
  } catch (nb::python_error& error) {
    error.restore();
  }
  return nullptr;
}
inline PyObject* get_slices(PyObject* self, void*) noexcept {
  PyObject* slices = reinterpret_cast<Rows*>(self)->slices;
  return slices == nullptr ? Py_NewRef(Py_None) : Py_NewRef(slices);
}
inline int put(PyObject*& into, PyObject* value) {
  if (value == nullptr) return PyErr_SetString(PyExc_AttributeError, "cannot be deleted"), -1;
  PyObject* before = into;
  into = Py_NewRef(value);
  Py_XDECREF(before);
  return 0;
}
inline int set_rows(PyObject* self, PyObject* value, void*) noexcept {
  return put(reinterpret_cast<Rows*>(self)->rows, value);
}
inline int set_slices(PyObject* self, PyObject* value, void*) noexcept {
  return put(reinterpret_cast<Rows*>(self)->slices, value);
}

inline PyTypeObject*& rows_type() {
  static PyTypeObject* type = nullptr;
  return type;
}
inline nb::object make_type() {
  static PyGetSetDef attributes[] = {{"rows", &get_rows, &set_rows, nullptr, nullptr},
                                     {"_slices", &get_slices, &set_slices, nullptr, nullptr},
                                     {nullptr, nullptr, nullptr, nullptr, nullptr}};
  static PyType_Slot slots[] = {{Py_tp_new, reinterpret_cast<void*>(&PyType_GenericNew)},
                                {Py_tp_dealloc, reinterpret_cast<void*>(&destroy)},
                                {Py_tp_getset, attributes},
                                {0, nullptr}};
  static PyType_Spec spec = {"touchline._core.Rows", static_cast<int>(offsetof(Rows, numbers)),
                             static_cast<int>(sizeof(double)), Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE,
                             slots};
  nb::object type = nb::steal(PyType_FromSpec(&spec));
  if (!type.is_valid()) throw nb::python_error();
  rows_type() = reinterpret_cast<PyTypeObject*>(type.ptr());
  return type;
}

// What the class calls a part, which stands in the dict of its slices under that name; and how it is
// read in Python.
struct Part {
  std::string name, doc;
  nb::object key, read;
  std::optional<std::size_t> columns;  // none: it is a whole number
  PyGetSetDef definition;
  nb::object slices;  // the dict that was asked last, and what it said
  std::size_t first = 0, last = 0;

  // Finds [first, last) in a dict of slices; false where it is not there.
  bool find(PyObject* in) {
    if (in == slices.ptr()) return true;
    if (in == nullptr || !PyDict_Check(in)) return false;
    PyObject* slice = PyDict_GetItemWithError(in, key.ptr());
    if (slice == nullptr) return false;
    std::tie(first, last) = arrays::ends(slice);
    slices = nb::borrow(in);
    return true;
  }
};

inline nb::object value(Part& part, PyObject* estimate) {
  Rows* of = reinterpret_cast<Rows*>(estimate);
  if (!part.find(of->slices)) return part.read(nb::handle(estimate));  // which tells what is wrong
  if (of->rows != nullptr) {
    if (part.columns) return arrays::view(of->rows, part.first, part.last, *part.columns);
    const bool one = PyArray_Check(of->rows) &&
                     PyArray_NDIM(reinterpret_cast<PyArrayObject*>(of->rows)) == 1;
    return one ? nb::steal(PyLong_FromLongLong(arrays::whole(of->rows, part.first)))
               : part.read(nb::handle(estimate));
  }
  if (part.last > of->count()) throw nb::type_error("not an estimate with these columns");
  if (part.columns) return shown(of, part.first, part.last - part.first, *part.columns);
  return nb::steal(PyLong_FromLongLong(static_cast<long long>(of->numbers[part.first])));
}

inline PyObject* read(PyObject* estimate, void* part) noexcept {
  try {
    return value(*static_cast<Part*>(part), estimate).release().ptr();
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
  if (!PyType_IsSubtype(reinterpret_cast<PyTypeObject*>(type.ptr()), rows_type()))
    throw nb::type_error("not a class of rows");
  const nb::object property = type.attr(name.c_str());
  Part* part = new Part{name, nb::cast<std::string>(nb::str(property.attr("__doc__"))),
                        at_once::interned(name.c_str()), property.attr("fget"), columns, {}, {}};
  part->definition = {part->name.c_str(), &read, nullptr, part->doc.c_str(), part};
  const nb::object descriptor = nb::steal(
      PyDescr_NewGetSet(reinterpret_cast<PyTypeObject*>(type.ptr()), &part->definition));
  if (!descriptor.is_valid()) throw nb::python_error();
  nb::setattr(type, name.c_str(), descriptor);
}

// An observer each of whose updates makes an instance of a class.
struct Estimating {
  Estimating(guard::Shared<tl::Observer>& observer, nb::object type, nb::object slices)
      : observer(observer), type(std::move(type)), slices(std::move(slices)) {
    if (!PyType_IsSubtype(reinterpret_cast<PyTypeObject*>(this->type.ptr()), rows_type()))
      throw nb::type_error("not a class of rows");
  }
  guard::Shared<tl::Observer>& observer;
  nb::object type, slices;

  nb::object update(double time, nb::handle q, nb::handle qd, nb::handle tau, nb::handle wrench) {
    tl::Observer& o = observer.value;
    const tl::Sample in = samples::one(o.row_layout(), time, q, qd, tau, wrench);
    const std::size_t width = o.output().size();
    const nb::object estimate = nb::steal(PyType_GenericAlloc(
        reinterpret_cast<PyTypeObject*>(type.ptr()), static_cast<Py_ssize_t>(width)));
    if (!estimate.is_valid()) throw nb::python_error();
    Rows* of = reinterpret_cast<Rows*>(estimate.ptr());
    of->slices = nb::object(slices).release().ptr();
    const guard::Turn turn(observer.turn);
    std::copy_n(o.step(in), width, of->numbers);
    return estimate;
  }
};

inline void bind(nb::module_& m) {
  m.attr("Rows") = make_type();
  m.def("read_natively", &read_natively, "type"_a, "name"_a, "columns"_a.none(),
        nb::sig("def read_natively(type: type, name: str, columns: int | None) -> None"));
  nb::class_<Estimating>(m, "Estimating")
      .def(nb::init<guard::Shared<tl::Observer>&, nb::object, nb::object>(), nb::keep_alive<1, 2>(),
           "observer"_a, "type"_a, "slices"_a,
           nb::sig("def __init__(self, observer: Observer, type: type, slices: dict[str, slice]) -> None"))
      .def("update", &Estimating::update, "time"_a, "q"_a, "qd"_a, "tau"_a, "wrench"_a,
           nb::sig("def update(self, time: float, q: object, qd: object, tau: object, wrench: object) "
                   "-> object"))
      .def_static("take_over", &at_once::take_over<Estimating>, "type"_a,
                  nb::sig("def take_over(type: type) -> None"));
}

}  // namespace touchline::estimates
