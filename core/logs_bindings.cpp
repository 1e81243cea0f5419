// SPDX-License-Identifier: Apache-2.0
// Readers of recordings for Python, as the module `touchline._logs`.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "logs/cdr.hpp"
#include "logs/csv.hpp"
#include "logs/mcap.hpp"

namespace nb = nanobind;
namespace logs = touchline::logs;
using namespace nb::literals;

namespace {

using Integers = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<const std::uint8_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Doubles = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

template <class Number>
class Table {
 public:
  Table(std::size_t rows, std::size_t columns, Number value)
      : rows_(rows), columns_(columns), numbers_(new Number[std::max<std::size_t>(rows * columns, 1)]) {
    std::fill_n(numbers_.get(), rows * columns, value);
  }
  Number* row(std::size_t i) { return numbers_.get() + i * columns_; }
  nb::object array(bool flat) {
    Number* raw = numbers_.release();
    nb::capsule owner(raw, [](void* p) noexcept { delete[] static_cast<Number*>(p); });
    const std::size_t shape[2] = {rows_, columns_};
    return nb::cast(nb::ndarray<nb::numpy, Number>(raw, flat ? 1 : 2, shape, owner));
  }

 private:
  std::size_t rows_, columns_;
  std::unique_ptr<Number[]> numbers_;
};

nb::object array(const std::vector<std::int64_t>& values) {
  Table<std::int64_t> table(values.size(), 1, 0);
  std::copy(values.begin(), values.end(), table.row(0));
  return table.array(true);
}

// Messages in a buffer: (start, size) of each, checked.
struct Messages {
  Messages(const nb::bytes& buffer, const Integers& start, const Integers& size)
      : data(reinterpret_cast<const std::uint8_t*>(buffer.c_str())),
        starts(start.data()), sizes(size.data()), count(start.shape(0)) {
    const auto length = static_cast<std::int64_t>(buffer.size());
    if (size.shape(0) != count) throw std::invalid_argument("as many sizes as starts are needed");
    for (std::size_t i = 0; i < count; ++i)
      if (starts[i] < 0 || sizes[i] < 0 || starts[i] > length || sizes[i] > length - starts[i])
        throw std::out_of_range("a message lies outside of its buffer");
  }
  const std::uint8_t* data;
  const std::int64_t *starts, *sizes;
  std::size_t count;
};

nb::tuple joint_states(logs::JointStateDecoder& decoder, const nb::bytes& buffer,
                       const Integers& start, const Integers& size) {
  const Messages messages(buffer, start, size);
  const std::size_t m = messages.count, n = decoder.width();
  Table<double> stamps(m, 1, logs::kNan), q(m, n, logs::kNan), qd(m, n, logs::kNan),
      tau(m, n, logs::kNan);
  Table<bool> complete(m, 1, false);
  std::size_t damaged = 0;
  {
    nb::gil_scoped_release release;
    for (std::size_t i = 0; i < m; ++i) {
      const logs::JointStateRow row{stamps.row(i), q.row(i), qd.row(i), tau.row(i),
                                    complete.row(i)};
      damaged += !decoder.decode(messages.data + messages.starts[i],
                                 static_cast<std::size_t>(messages.sizes[i]), row);
    }
  }
  return nb::make_tuple(stamps.array(true), q.array(false), qd.array(false), tau.array(false),
                        complete.array(true), damaged);
}

nb::tuple wrenches(const nb::bytes& buffer, const Integers& start, const Integers& size) {
  const Messages messages(buffer, start, size);
  const std::size_t m = messages.count;
  Table<double> stamps(m, 1, logs::kNan), values(m, 6, logs::kNan);
  std::size_t damaged = 0;
  {
    nb::gil_scoped_release release;
    for (std::size_t i = 0; i < m; ++i)
      damaged += !logs::decode_wrench(messages.data + messages.starts[i],
                                      static_cast<std::size_t>(messages.sizes[i]), stamps.row(i),
                                      values.row(i));
  }
  return nb::make_tuple(stamps.array(true), values.array(false), damaged);
}

nb::tuple chunk_messages(const nb::bytes& records, const Flags& wanted, const Integers& index) {
  if (wanted.shape(0) != 65536) throw std::invalid_argument("a flag per channel is needed");
  logs::ChunkMessages found;
  {
    nb::gil_scoped_release release;
    found = logs::find_messages(reinterpret_cast<const std::uint8_t*>(records.c_str()),
                                records.size(), wanted.data(), index.data(), index.shape(0));
  }
  return nb::make_tuple(array(found.channel), array(found.received), array(found.start),
                        array(found.size), found.damaged);
}

nb::tuple read_csv(const nb::bytes& text, char delimiter, std::size_t cells,
                   const std::vector<std::size_t>& wanted) {
  if (!std::is_sorted(wanted.begin(), wanted.end()))
    throw std::invalid_argument("columns must increase");
  logs::CsvTable table;
  {
    nb::gil_scoped_release release;
    table = logs::read_csv({text.c_str(), text.size()}, delimiter, cells, wanted);
  }
  Table<double> values(table.rows, wanted.size(), 0.0);
  std::copy(table.values.begin(), table.values.end(), values.row(0));
  nb::object problem = nb::none();
  if (table.problem.found) {
    const std::string& cell = table.problem.cell;
    problem = nb::make_tuple(table.problem.line, table.problem.cells, table.problem.column,
                             nb::bytes(cell.data(), cell.size()));
  }
  return nb::make_tuple(values.array(false), table.lines, problem);
}

nb::bytes write_csv(const Doubles& values) {
  std::string text;
  {
    nb::gil_scoped_release release;
    text = logs::write_csv(values.data(), values.shape(0), values.shape(1));
  }
  return nb::bytes(text.data(), text.size());
}

#define TOUCHLINE_NUMBERS "numpy.typing.NDArray[numpy.float64]"
#define TOUCHLINE_INTEGERS "numpy.typing.NDArray[numpy.int64]"
#define TOUCHLINE_FLAGS "numpy.typing.NDArray[numpy.bool_]"

}  // namespace

NB_MODULE(_logs, m) {
  m.doc() = "Native readers of recordings: CDR messages, MCAP chunks and CSV text.";
  nb::class_<logs::JointStateDecoder>(m, "JointStateDecoder",
                                      "Reads JointState messages in the order of given joints.")
      .def(nb::init<std::vector<std::string>>(), "joints"_a)
      .def("decode", &joint_states, "buffer"_a, "start"_a, "size"_a,
           nb::sig("def decode(self, buffer: bytes, start: " TOUCHLINE_INTEGERS
                   ", size: " TOUCHLINE_INTEGERS ") -> tuple[" TOUCHLINE_NUMBERS
                   ", " TOUCHLINE_NUMBERS ", " TOUCHLINE_NUMBERS ", " TOUCHLINE_NUMBERS
                   ", " TOUCHLINE_FLAGS ", int]"),
           "Stamps (m,) [s], position, velocity, effort (m, n), which messages name every joint "
           "(m,), and how many are damaged. NaN is what a message lacks.")
      .def_prop_ro("seen", &logs::JointStateDecoder::seen,
                   nb::sig("def seen(self, /) -> list[str]"),
                   "Names of all joints met so far, in the order in which they came.");
  m.def("decode_wrenches", &wrenches, "buffer"_a, "start"_a, "size"_a,
        nb::sig("def decode_wrenches(buffer: bytes, start: " TOUCHLINE_INTEGERS
                ", size: " TOUCHLINE_INTEGERS ") -> tuple[" TOUCHLINE_NUMBERS
                ", " TOUCHLINE_NUMBERS ", int]"),
        "Stamps (m,) [s], wrenches (m, 6) [N, Nm] of WrenchStamped messages, and how many are "
        "damaged.");
  m.def("chunk_messages", &chunk_messages, "records"_a, "wanted"_a, "index"_a,
        nb::sig("def chunk_messages(records: bytes, wanted: numpy.typing.NDArray[numpy.uint8], "
                "index: " TOUCHLINE_INTEGERS ") -> tuple[" TOUCHLINE_INTEGERS
                ", " TOUCHLINE_INTEGERS ", " TOUCHLINE_INTEGERS ", " TOUCHLINE_INTEGERS
                ", bool]"),
        "Channel, time received [ns], start and size of each message in an MCAP chunk's records, "
        "and whether something in it is damaged; `wanted` has a flag per channel, `index` the "
        "offsets of messages as the file's indexes tell them.");
  m.def("read_csv", &read_csv, "text"_a, "delimiter"_a, "cells"_a, "wanted"_a,
        nb::sig("def read_csv(text: bytes, delimiter: str, cells: int, wanted: list[int]) -> "
                "tuple[" TOUCHLINE_NUMBERS ", int, tuple[int, int, int, bytes] | None]"),
        "Wanted columns (N, w) of whole lines, the number of lines read, and the first problem: "
        "its line, the number of cells where that is wrong, else 0, its column and what stands "
        "there.");
  m.def("write_csv", &write_csv, "values"_a,
        nb::sig("def write_csv(values: " TOUCHLINE_NUMBERS ") -> bytes"),
        "Rows of numbers (N, w) as text that reads back to the last bit; NaN is an empty cell.");
}
