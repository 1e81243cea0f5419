// SPDX-License-Identifier: Apache-2.0
// NumPy arrays in and out, as fast as NumPy allows: a call per sample takes five of them.
#pragma once

#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#define NPY_TARGET_VERSION NPY_2_0_API_VERSION
#include <nanobind/nanobind.h>
#include <numpy/arrayobject.h>

#include <algorithm>
#include <cstddef>
#include <initializer_list>
#include <utility>
#include <vector>

namespace touchline::arrays {

namespace nb = nanobind;

// To be called once, when the module is imported.
inline void initialize() {
  if (PyArray_ImportNumPyAPI() < 0) throw nb::python_error();
}

// The numbers of an array of float64 of exactly this shape, rows one after the other. Anything
// else is a TypeError: the caller in Python then converts, or tells what is wrong.
inline const double* numbers(nb::handle object, std::initializer_list<std::size_t> shape) {
  if (!PyArray_Check(object.ptr())) throw nb::type_error("not an array");
  PyArrayObject* array = reinterpret_cast<PyArrayObject*>(object.ptr());
  if (PyArray_TYPE(array) != NPY_DOUBLE || !PyArray_ISCARRAY_RO(array))
    throw nb::type_error("not an array of float64, row by row");
  bool same = PyArray_NDIM(array) == static_cast<int>(shape.size());
  const npy_intp* size = PyArray_DIMS(array);
  for (const std::size_t wanted : shape) {
    if (!same) break;
    same = static_cast<std::size_t>(*size++) == wanted;
  }
  if (!same) throw nb::type_error("another shape");
  return static_cast<const double*>(PyArray_DATA(array));
}

// The length of an array of float64 with one axis.
inline std::size_t length(nb::handle object) {
  if (!PyArray_Check(object.ptr())) throw nb::type_error("not an array");
  PyArrayObject* array = reinterpret_cast<PyArrayObject*>(object.ptr());
  return PyArray_NDIM(array) == 1 ? static_cast<std::size_t>(PyArray_DIMS(array)[0]) : 0;
}

// The same; `missing` where the object is None.
inline const double* numbers_or(nb::handle object, std::initializer_list<std::size_t> shape,
                                const double* missing) {
  return object.is_none() ? missing : numbers(object, shape);
}

// A new array, not initialized.
class Out {
 public:
  explicit Out(std::initializer_list<std::size_t> shape) {
    npy_intp dims[4] = {};
    std::size_t axes = 0;
    for (const std::size_t size : shape) dims[axes++] = static_cast<npy_intp>(size);
    object_ = nb::steal(PyArray_SimpleNew(static_cast<int>(axes), dims, NPY_DOUBLE));
    if (!object_.is_valid()) throw nb::python_error();
  }
  double* data() const {
    return static_cast<double*>(PyArray_DATA(reinterpret_cast<PyArrayObject*>(object_.ptr())));
  }
  nb::object release() { return std::move(object_); }

 private:
  nb::object object_;
};

// Numbers as a new array with one axis.
inline nb::object line(const std::vector<double>& values) {
  Out out({values.size()});
  std::copy(values.begin(), values.end(), out.data());
  return out.release();
}

// Where a slice of columns begins and ends.
inline std::pair<std::size_t, std::size_t> ends(nb::handle part) {
  Py_ssize_t start, stop, step;
  if (!PySlice_Check(part.ptr())) throw nb::type_error("not a slice");
  if (PySlice_Unpack(part.ptr(), &start, &stop, &step) < 0) throw nb::python_error();
  if (start < 0 || stop < start || step != 1) throw nb::type_error("not a slice of columns");
  return {static_cast<std::size_t>(start), static_cast<std::size_t>(stop)};
}

// A new array that shows numbers of `owner`, which lives as long as it.
inline nb::object shown(nb::handle owner, int axes, npy_intp* dims, npy_intp* strides, void* data,
                        int flags) {
  nb::object out = nb::steal(PyArray_NewFromDescr(&PyArray_Type, PyArray_DescrFromType(NPY_DOUBLE), axes,
                                                  dims, strides, data, flags, nullptr));
  if (!out.is_valid()) throw nb::python_error();
  owner.inc_ref();
  if (PyArray_SetBaseObject(reinterpret_cast<PyArrayObject*>(out.ptr()), owner.ptr()) < 0)
    throw nb::python_error();
  return out;
}

// Columns [first, last) of an array of float64 (..., width) as a view: (..., count), or
// (..., count / columns, columns) unless `columns` is 0.
inline nb::object view(nb::handle object, std::size_t first, std::size_t last, std::size_t columns) {
  const std::size_t count = last - first;
  if (!PyArray_Check(object.ptr())) throw nb::type_error("not an array");
  PyArrayObject* array = reinterpret_cast<PyArrayObject*>(object.ptr());
  constexpr int kMostAxes = 4;
  const int axes = PyArray_NDIM(array);
  if (PyArray_TYPE(array) != NPY_DOUBLE || axes < 1 || axes > kMostAxes ||
      static_cast<std::size_t>(PyArray_DIMS(array)[axes - 1]) < last)
    throw nb::type_error("not an array of float64 with these columns");
  npy_intp dims[kMostAxes + 1], strides[kMostAxes + 1];
  std::copy_n(PyArray_DIMS(array), axes, dims);
  std::copy_n(PyArray_STRIDES(array), axes, strides);
  const npy_intp step = strides[axes - 1];
  const bool split = columns > 0;
  dims[axes - 1] = static_cast<npy_intp>(split ? count / columns : count);
  if (split) {
    dims[axes] = static_cast<npy_intp>(columns);
    strides[axes] = step;
    strides[axes - 1] = static_cast<npy_intp>(columns) * step;
  }
  char* data = PyArray_BYTES(array) + static_cast<npy_intp>(first) * step;
  return shown(object, axes + (split ? 1 : 0), dims, strides, data,
               PyArray_FLAGS(array) & NPY_ARRAY_WRITEABLE);
}
inline nb::object view(nb::handle object, nb::handle part, std::size_t columns) {
  const auto [first, last] = ends(part);
  return view(object, first, last, columns);
}

// The number in a column of an array of float64 with one axis, or at the beginning of a slice of it, as
// an integer.
inline long long whole(nb::handle object, std::size_t at) {
  if (length(object) <= at || PyArray_TYPE(reinterpret_cast<PyArrayObject*>(object.ptr())) != NPY_DOUBLE)
    throw nb::type_error("not an array of float64 with this number");
  PyArrayObject* array = reinterpret_cast<PyArrayObject*>(object.ptr());
  return static_cast<long long>(
      *static_cast<const double*>(PyArray_GETPTR1(array, static_cast<npy_intp>(at))));
}
inline long long whole(nb::handle object, nb::handle part) { return whole(object, ends(part).first); }

// Numbers row by row as a new array.
inline nb::object table(const std::vector<double>& values, std::size_t columns) {
  Out out({values.size() / columns, columns});
  std::copy(values.begin(), values.end(), out.data());
  return out.release();
}

}  // namespace touchline::arrays
