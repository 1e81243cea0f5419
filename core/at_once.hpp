// SPDX-License-Identifier: Apache-2.0
// Methods of Python's classes that the core answers without a detour through Python, which takes
// longer than a sample: `update` of those that make a result of each sample.
#pragma once

#include <nanobind/nanobind.h>

#include <exception>
#include <stdexcept>
#include <string>

namespace touchline::at_once {

namespace nb = nanobind;

// A name as Python keeps it.
inline nb::object interned(const char* name) { return nb::steal(PyUnicode_InternFromString(name)); }

// What an instance has: the `Making` that answers for it, and the method of Python for all that is
// no array of float64 yet.
struct Names {
  nb::object making = interned("_making"), any = interned("_update_any");
};
inline const Names& names() {
  static const Names* const both = new Names;  // outlives the interpreter
  return *both;
}

inline PyObject* told(const std::exception& error) {
  const bool value = dynamic_cast<const std::invalid_argument*>(&error) != nullptr;
  PyErr_SetString(value ? PyExc_ValueError : PyExc_RuntimeError, error.what());
  return nullptr;
}

// `self.update(time, q, qd, tau, wrench)`.
template <class Making>
PyObject* update(PyObject* self, PyObject* const* args, Py_ssize_t count, PyObject* keywords) noexcept {
  try {
    if (keywords == nullptr && count == 5 && PyFloat_Check(args[0])) {
      try {
        const nb::object making = nb::steal(PyObject_GetAttr(self, names().making.ptr()));
        if (!making.is_valid()) return nullptr;
        return nb::cast<Making&>(making)
            .update(PyFloat_AsDouble(args[0]), args[1], args[2], args[3], args[4])
            .release()
            .ptr();
      } catch (const nb::builtin_exception&) {  // some are no arrays of float64 yet
      }
    }
    const nb::object any = nb::steal(PyObject_GetAttr(self, names().any.ptr()));
    return any.is_valid() ? PyObject_Vectorcall(any.ptr(), args, static_cast<std::size_t>(count), keywords)
                          : nullptr;
  } catch (nb::python_error& error) {
    error.restore();
    return nullptr;
  } catch (const std::exception& error) {
    return told(error);
  }
}

// From now on `type.update` is answered by the `_making` of its instances, where all signals are arrays
// of float64 already. What it was before is `type._update_any`, and its documentation stays.
template <class Making>
void take_over(nb::handle type) {
  const nb::object before = type.attr("update");
  const std::string doc = nb::cast<std::string>(nb::str(before.attr("__doc__")));
  struct Method {
    std::string doc;
    PyMethodDef definition;
  };
  Method* method = new Method{"update($self, time, q, qd, tau=None, wrench=None)\n--\n\n" + doc, {}};
  const auto function = reinterpret_cast<void (*)()>(&update<Making>);  // of two casts no compiler warns
  method->definition = {"update", reinterpret_cast<PyCFunction>(function),
                        METH_FASTCALL | METH_KEYWORDS, method->doc.c_str()};
  const nb::object descriptor = nb::steal(
      PyDescr_NewMethod(reinterpret_cast<PyTypeObject*>(type.ptr()), &method->definition));
  if (!descriptor.is_valid()) throw nb::python_error();
  nb::setattr(type, "_update_any", before);
  nb::setattr(type, "update", descriptor);
}

}  // namespace touchline::at_once
