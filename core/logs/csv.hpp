// SPDX-License-Identifier: Apache-2.0
// Tables of numbers as text: reads the wanted columns of whole lines, writes rows.
#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace touchline::logs {

// Why a text could not be read on.
struct CsvProblem {
  bool found = false;
  std::size_t line = 0;      // of the text, from 0
  std::size_t cells = 0;     // of that line, where their number is wrong; else 0
  std::size_t column = 0;    // of the cell that is no number
  std::string cell;          // what stands there
};

struct CsvTable {
  std::vector<double> values;  // row by row
  std::size_t rows = 0, lines = 0;
  CsvProblem problem;
};

inline std::string_view stripped(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

// What programs write for a value that is not there.
inline bool is_null(std::string_view cell) {
  for (const char* word : {"", "null", "NULL", "None", "NA", "N/A"})
    if (cell == word) return true;
  return false;
}

inline bool read_number(std::string_view cell, double* value) {
  const std::size_t size = cell.size();
  const char *start = cell.data(), *end = start + size;
  if (start != end && *start == '+') ++start;
  const auto [last, error] = std::from_chars(start, end, *value);
  if (last == end && error == std::errc()) return true;
  if (last == end && error == std::errc::result_out_of_range) {
    *value = std::strtod(std::string(cell).c_str(), nullptr);  // 0 or infinity
    return true;
  }
  cell = stripped(cell);
  if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"')
    cell = stripped(cell.substr(1, cell.size() - 2));
  if (is_null(cell)) {
    *value = std::numeric_limits<double>::quiet_NaN();
    return true;
  }
  if (cell.size() == size) return false;  // nothing was taken off
  return cell.front() != '"' && read_number(cell, value);
}

// Where a cell ends: at a delimiter or `end`, but not inside quotes.
inline const char* cell_end(const char* at, const char* end, char delimiter) {
  if (at != end && *at == '"') {
    for (++at; at != end; ++at) {
      if (*at != '"') continue;
      if (at + 1 != end && at[1] == '"') {
        ++at;
        continue;
      }
      break;
    }
  }
  while (at != end && *at != delimiter) ++at;
  return at;
}

// Reads whole lines of `cells` cells; `wanted` are increasing numbers of columns. Empty lines do
// not count. Ends at the first line that does not fit.
inline CsvTable read_csv(std::string_view text, char delimiter, std::size_t cells,
                         const std::vector<std::size_t>& wanted) {
  CsvTable table;
  const char *at = text.data(), *end = at + text.size();
  table.values.reserve(wanted.size() * (static_cast<std::size_t>(
                           std::count(at, end, '\n')) + 1));
  while (at != end) {
    const char* newline = static_cast<const char*>(
        std::memchr(at, '\n', static_cast<std::size_t>(end - at)));
    const char* next = newline ? newline + 1 : end;
    const char* stop = newline ? newline : end;
    if (stop != at && stop[-1] == '\r') --stop;
    if (stripped({at, static_cast<std::size_t>(stop - at)}).empty() && cells > 1) {
      at = next;
      ++table.lines;
      continue;
    }
    const std::size_t kept = table.values.size();
    std::size_t column = 0, taken = 0;
    const char* cell = at;
    for (;; ++column) {
      const char* last = cell_end(cell, stop, delimiter);
      if (taken < wanted.size() && wanted[taken] == column) {
        double value = 0.0;
        const std::string_view found(cell, static_cast<std::size_t>(last - cell));
        if (!read_number(found, &value) && !table.problem.found)
          table.problem = {true, table.lines, 0, column, std::string(found.substr(0, 200))};
        table.values.push_back(value);
        ++taken;
      }
      if (last == stop) break;
      cell = last + 1;
    }
    if (column + 1 != cells) table.problem = {true, table.lines, column + 1, 0, {}};
    if (table.problem.found) {
      table.values.resize(kept);
      break;
    }
    ++table.rows;
    ++table.lines;
    at = next;
  }
  return table;
}

// Rows as text; each number as short as it can be read back to the last bit, NaN as nothing.
inline std::string write_csv(const double* values, std::size_t rows, std::size_t columns) {
  std::string text;
  text.reserve(rows * columns * 20);
  char digits[32];
  for (std::size_t i = 0; i < rows; ++i) {
    for (std::size_t j = 0; j < columns; ++j) {
      const double value = *values++;
      if (j) text.push_back(',');
      if (!std::isnan(value))
        text.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
    }
    text.push_back('\n');
  }
  return text;
}

}  // namespace touchline::logs
