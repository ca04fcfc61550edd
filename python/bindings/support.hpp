// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include "cairn/core/error.hpp"
#include "cairn/core/execution.hpp"
#include "cairn/core/option_table.hpp"
#include "cairn/geometry/similarity3.hpp"
#include "cairn/map/landmark_map.hpp"

/// Shared by all bindings: arrays in and out, long calls, options by keyword.
namespace cairn::python {

namespace py = pybind11;

/// Maps are immutable, so Python and views of their columns share them.
using SharedMap = std::shared_ptr<LandmarkMap>;

// --- Each part of the module ------------------------------------------------------------------------

void bind_errors(py::module_& module);
void bind_maps(py::module_& module);
void bind_alignment(py::module_& module);
void bind_evaluation(py::module_& module);
void bind_experiments(py::module_& module);
void bind_report(py::module_& module);
void bind_merging(py::module_& module);
void bind_atlas(py::module_& module);
void bind_simulation(py::module_& module);
void bind_localization(py::module_& module);
void bind_odometry(py::module_& module);

// --- Long calls -------------------------------------------------------------------------------------

/// The keywords `threads` and `progress` of every long function, and `seed` of those that draw random numbers.
struct CallOptions {
  unsigned threads = 0;              ///< largest number; 0: one per core
  py::object progress = py::none();  ///< None, True (a tqdm bar) or a callable that takes a share
  std::uint64_t seed = 0;
};

/// Runs `work` in its own thread, without the GIL, while the calling thread handles signals and reports
/// progress. If a signal handler (KeyboardInterrupt) or the progress callable raises, stops the work, and
/// raises the exception when the work has ended.
/// @param name of the work, shown beside the progress bar
void run(const std::string& name, const CallOptions& call,
         const std::function<void(const Execution&)>& work);

/// Calls `work` without the GIL; for short calls that need neither progress nor interruption.
template <class Work>
auto unlocked(const Work& work) {
  const py::gil_scoped_release released;
  return work();
}

// --- Arrays -----------------------------------------------------------------------------------------

/// A read-only array that views `data`, which `owner` keeps alive.
/// @param strides in bytes; empty: row-major without gaps
template <class Scalar>
py::array view(const Scalar* data, std::vector<py::ssize_t> shape, py::handle owner,
               std::vector<py::ssize_t> strides = {}) {
  if (strides.empty()) {
    strides.resize(shape.size());
    py::ssize_t stride = sizeof(Scalar);
    for (std::size_t i = shape.size(); i-- > 0;) {
      strides[i] = stride;
      stride *= shape[i];
    }
  }
  py::array array(py::dtype::of<Scalar>(), std::move(shape), std::move(strides), data, owner);
  array.attr("setflags")(py::arg("write") = false);
  return array;
}

/// An array that owns a copy of the numbers.
template <class Scalar>
py::array copied(const std::vector<Scalar>& values, std::vector<py::ssize_t> shape) {
  return py::array_t<Scalar>(std::move(shape), values.data());
}
template <class Scalar>
py::array copied(const std::vector<Scalar>& values) {
  return copied(values, {static_cast<py::ssize_t>(values.size())});
}

/// (n, k): for each item the numbers that `row` returns of it, a std::array.
template <class Items, class Row>
py::array row_array(const Items& items, const Row& row) {
  using Numbers = decltype(row(*std::begin(items)));
  using Number = typename Numbers::value_type;
  py::array_t<Number> array({std::size(items), std::tuple_size_v<Numbers>});
  Number* out = array.mutable_data();
  for (const auto& item : items) {
    const Numbers numbers = row(item);
    out = std::copy(numbers.begin(), numbers.end(), out);
  }
  return array;
}

/// A copy of a matrix or vector.
template <class Matrix>
py::array copied_matrix(const Matrix& matrix) {
  if constexpr (Matrix::ColsAtCompileTime == 1) {
    py::array_t<double> array(matrix.size());
    for (Eigen::Index i = 0; i < matrix.size(); ++i) array.mutable_at(i) = matrix[i];
    return array;
  } else {
    py::array_t<double> array({matrix.rows(), matrix.cols()});
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
      for (Eigen::Index j = 0; j < matrix.cols(); ++j) array.mutable_at(i, j) = matrix(i, j);
    }
    return array;
  }
}

/// (n, 4, 4).
py::array pose_arrays(const std::vector<Rigid3>& poses);

/// What an argument makes of an array's masked entries (numpy.ma).
enum class Masked {
  kRefused,  ///< the argument has no unknown entries
  kUnknown,  ///< they are NaN among real numbers; elsewhere known_rows() tells them
};

/// @param shape -1 for any length
/// @param name  of the argument, for error messages
/// @throws TypeError unless it is an array of real numbers, Error (misuse) for another shape or a masked entry
py::array_t<double> real_array(py::handle value, std::string_view name,
                               const std::vector<py::ssize_t>& shape,
                               Masked masked = Masked::kRefused);
/// The same for integers: floats are refused.
py::array_t<std::int64_t> integer_array(py::handle value, std::string_view name,
                                        const std::vector<py::ssize_t>& shape,
                                        Masked masked = Masked::kRefused);
/// The same for ids: integers from 0 to 2^64 - 1.
py::array_t<std::uint64_t> id_array(py::handle value, std::string_view name,
                                    const std::vector<py::ssize_t>& shape);
py::array_t<std::uint8_t> byte_array(py::handle value, std::string_view name,
                                     const std::vector<py::ssize_t>& shape,
                                     Masked masked = Masked::kRefused);
/// The same for True and False.
py::array_t<bool> flag_array(py::handle value, std::string_view name,
                             const std::vector<py::ssize_t>& shape);
/// For each of the `count` rows of a checked array: 1, or 0 if an entry is masked.
std::vector<std::uint8_t> known_rows(py::handle value, std::size_t count);

/// (n, 3).
std::vector<Eigen::Vector3d> positions_of(py::handle value, std::string_view name);
/// (kRows, kRows).
template <int kRows>
Eigen::Matrix<double, kRows, kRows> matrix_of(py::handle value, std::string_view name) {
  const auto array = real_array(value, name, {kRows, kRows});
  return Eigen::Map<const Eigen::Matrix<double, kRows, kRows, Eigen::RowMajor>>(array.data());
}
/// (n, 4, 4) of scale 1.
std::vector<Rigid3> rigids_of(py::handle value, std::string_view name);
/// (4, 4): a rigid motion or similarity.
Similarity3 similarity_of(py::handle value, std::string_view name);
/// (4, 4) of scale 1.
Rigid3 rigid_of(py::handle value, std::string_view name);

/// Words for values.
template <class Value>
using Words = std::vector<std::pair<std::string_view, Value>>;

/// @throws Error (misuse) naming the argument and all words, for another text
template <class Value>
Value word(const std::string& text, std::string_view name, const Words<Value>& words) {
  std::string expected;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i].first == text) return words[i].second;
    expected += (i == 0 ? "" : i + 1 == words.size() ? " or " : ", ");
    expected += "'" + std::string(words[i].first) + "'";
  }
  throw Error(ErrorKind::kMisuse, name, printable(text), expected);
}

// --- Options by keyword -----------------------------------------------------------------------------

/// A Python float; None for infinity, which means unlimited.
py::object to_python(double value);
py::object to_python(const std::optional<double>& value);
template <class Value>
  requires std::is_integral_v<Value>
py::object to_python(Value value) {
  return py::cast(value);
}
template <class Value>
  requires std::is_integral_v<Value>
py::object to_python(const std::optional<Value>& value) {
  return py::cast(value);
}
inline py::object to_python(const std::string& value) {
  return py::cast(value);
}

/// @throws TypeError naming the option, for a value of another type; Error (misuse) for one out of range
void from_python(py::handle value, const std::string& name, bool& result);
void from_python(py::handle value, const std::string& name, double& result);
void from_python(py::handle value, const std::string& name, std::string& result);
void from_python(py::handle value, const std::string& name, std::optional<double>& result);
std::int64_t integer_of(py::handle value, const std::string& name, std::int64_t least,
                        std::uint64_t most);
std::uint64_t unsigned_of(py::handle value, const std::string& name, std::uint64_t most);
template <class Value>
  requires(std::is_integral_v<Value> && !std::is_same_v<Value, bool>)
void from_python(py::handle value, const std::string& name, Value& result) {
  using Limits = std::numeric_limits<Value>;
  if constexpr (std::is_signed_v<Value>) {
    result = static_cast<Value>(
        integer_of(value, name, Limits::lowest(), static_cast<std::uint64_t>(Limits::max())));
  } else {
    result = static_cast<Value>(unsigned_of(value, name, Limits::max()));
  }
}
template <class Value>
  requires std::is_integral_v<Value>
void from_python(py::handle value, const std::string& name, std::optional<Value>& result) {
  if (value.is_none()) {
    result.reset();
  } else {
    from_python(value, name, result.emplace());
  }
}

/// @throws TypeError, always, for a `name` that is not in `names`; suggests a similar name if there is one
[[noreturn]] void refuse_keyword(const std::string& function, const std::string& name,
                                 const std::vector<std::string>& names);

/// The keywords of a function, each of which reads and sets a part of an options struct. Defaults come from
/// the struct, so signatures and documentation always agree with C++.
template <class Options>
class Keywords {
 public:
  using Set = std::function<void(Options&, py::handle)>;

  explicit Keywords(std::string function) : function_(std::move(function)) {}

  /// @param field returns a reference to the option, e.g. [](auto& o) -> auto& { return o.seed; }
  template <class Field>
  Keywords& add(const std::string& name, const Field& field) {
    Options defaults;
    return add(name, to_python(field(defaults)), [field, name](Options& options, py::handle value) {
      from_python(value, name, field(options));
    });
  }
  /// Adds the fields of a table, with its names, but for those in `but`.
  /// @param part returns a reference to the struct that has the table
  template <class Part>
  Keywords& add_table(const OptionTable& table, const Part& part,
                      std::initializer_list<std::string_view> but = {}) {
    Options defaults;
    for (const OptionField& field : table.fields) {
      if (std::find(but.begin(), but.end(), field.name) != but.end()) continue;
      const std::string name(field.name);
      const auto at = [part, get = field.value](Options& options) { return get(&part(options)); };
      const auto shown = [](const auto* value) { return to_python(*value); };
      add(name, std::visit(shown, at(defaults)), [at, name](Options& options, py::handle given) {
        std::visit([&](auto* value) { from_python(given, name, *value); }, at(options));
      });
    }
    return *this;
  }
  /// The same for an enumerator, by its word.
  template <class Field, class Value>
  Keywords& add(const std::string& name, const Field& field, const Words<Value>& words) {
    Options defaults;
    std::string initial;
    for (const auto& [text, value] : words) {
      if (value == field(defaults)) initial = text;
    }
    return add(name, py::str(initial), [=](Options& options, py::handle value) {
      std::string text;
      from_python(value, name, text);
      field(options) = word(text, name, words);
    });
  }
  /// Adds `seed`, which read() puts into the call.
  Keywords& add_seed() { return add("seed", to_python(CallOptions().seed), Set()); }
  /// @param initial the default value in Python
  Keywords& add(const std::string& name, const py::object& initial, Set set) {
    names_.push_back(name);
    defaults_.push_back(py::repr(initial).template cast<std::string>());
    sets_.push_back(std::move(set));
    return *this;
  }

  /// Reads the given keywords; also `threads` and `progress` if `call` is not null.
  Options read(const py::kwargs& given, CallOptions* call = nullptr) const {
    Options options;
    for (const auto& [key, value] : given) {
      const auto name = key.template cast<std::string>();
      if (call != nullptr && name == "threads") {
        from_python(value, name, call->threads);
        continue;
      }
      if (call != nullptr && name == "progress") {
        call->progress = py::reinterpret_borrow<py::object>(value);
        continue;
      }
      std::size_t i = 0;
      while (i < names_.size() && names_[i] != name) ++i;
      if (i == names_.size()) refuse_keyword(function_, name, names_);
      if (sets_[i]) {
        sets_[i](options, value);
      } else {
        from_python(value, name, call->seed);
      }
    }
    return options;
  }

  /// "align(source, target, *, method='robust', ...)\n--\n\n", from which inspect makes a signature.
  std::string signature(const std::string& positional, bool runs = true) const {
    std::string text = function_ + "(" + positional + (positional.empty() ? "*" : ", *");
    for (std::size_t i = 0; i < names_.size(); ++i) {
      text.append(", ").append(names_[i]).append("=").append(defaults_[i]);
    }
    if (runs) text += ", threads=0, progress=None";
    return text + ")\n--\n\n";
  }

 private:
  std::string function_;
  std::vector<std::string> names_;
  std::vector<std::string> defaults_;
  std::vector<Set> sets_;
};

/// Pickles objects of a class as the result of `pack`. Does not use __setstate__, because objects without a
/// value cannot exist (seal()).
/// @param name of the function in cairn._pickles that restores the object by `unpack`
template <class Class, class Pack, class Unpack>
void make_picklable(py::module_& module, Class& cls, const std::string& name, const Pack& pack,
                    const Unpack& unpack) {
  module.def(("_" + name).c_str(), unpack);
  cls.def("__reduce__", [name, pack](const py::object& self) {
    const py::object restore = py::module_::import("cairn._pickles").attr(name.c_str());
    return py::make_tuple(restore, py::make_tuple(pack(self)));
  });
}

/// Makes `Class.__new__(Class)` fail for all classes of the module, because it would create an object without
/// a value, in uninitialised memory.
void seal(py::module_& module);

/// Keeps a text for the lifetime of the process, for docstrings made at import.
const char* kept(std::string text);

}  // namespace cairn::python
