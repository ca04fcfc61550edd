// SPDX-License-Identifier: BSD-3-Clause
#include "bindings/support.hpp"

#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <exception>
#include <limits>
#include <mutex>
#include <thread>

#include <fmt/format.h>

#include "cairn/core/detail/memory.hpp"

#include "bindings/text.hpp"

namespace cairn::python {
namespace {

std::string type_name(py::handle value) {
  return py::str(py::type::handle_of(value).attr("__name__")).cast<std::string>();
}

std::string shape_text(const std::vector<py::ssize_t>& shape) {
  std::string text = "(";
  for (std::size_t i = 0; i < shape.size(); ++i) {
    if (i > 0) text += ", ";
    text += shape[i] < 0 ? "n" : std::to_string(shape[i]);
  }
  return text + (shape.size() == 1 ? ",)" : ")");
}

py::module_ numpy_ma() {
  return py::module_::import("numpy.ma");
}

std::size_t masked_entries(py::handle value) {
  const py::module_ ma = numpy_ma();
  if (!ma.attr("is_masked")(value).cast<bool>()) return 0;
  return ma.attr("count_masked")(value).cast<std::size_t>();
}

// An array of these kinds of numbers (NumPy's letters) and this shape; throws if it is not. The array has no mask.
py::array checked_array(py::handle value, std::string_view name,
                        const std::vector<py::ssize_t>& shape, std::string_view kinds,
                        std::string_view what, Masked masked = Masked::kRefused) {
  py::array array = py::array::ensure(value);
  // NumPy makes an array of everything, of a path and of None, too.
  const bool is_kind = array && kinds.find(array.dtype().kind()) != std::string_view::npos;
  if (!array || (!is_kind && array.ndim() == 0)) {
    PyErr_Clear();
    throw py::type_error(fmt::format("{}: {} is no array; expected {} of shape {}", name,
                                     type_name(value), what, shape_text(shape)));
  }
  std::vector<py::ssize_t> found(array.shape(), array.shape() + array.ndim());
  const bool empty = array.size() == 0;
  // NumPy makes [] an array of floats.
  if (!is_kind && !empty) {
    throw py::type_error(fmt::format("{}: array of {}; expected {}", name,
                                     py::str(array.dtype()).cast<std::string>(), what));
  }
  if (empty && found.size() == 1 && shape.front() < 0) {
    found = shape;
    found.front() = 0;
    array = array.reshape(found);
  }
  bool fits = found.size() == shape.size();
  for (std::size_t i = 0; fits && i < shape.size(); ++i) {
    fits = shape[i] < 0 || shape[i] == found[i];
  }
  refuse_if(!fits, name, "shape " + shape_text(found), "shape " + shape_text(shape));
  if (const std::size_t count = masked == Masked::kRefused ? masked_entries(value) : 0; count > 0) {
    throw Error(ErrorKind::kMisuse, name,
                fmt::format("{} masked {}", count, count == 1 ? "entry" : "entries"),
                fmt::format("{}, none of them masked", what));
  }
  return array;
}

template <class Scalar>
py::array_t<Scalar> cast_array(const py::array& array) {
  auto result = py::array_t<Scalar, py::array::c_style | py::array::forcecast>::ensure(array);
  if (!result) throw py::error_already_set();
  return result;
}

}  // namespace

void run(const std::string& name, const CallOptions& call,
         const std::function<void(const Execution&)>& work) {
  constexpr auto kGlance = std::chrono::milliseconds(20);
  py::object report = py::none();
  if (!call.progress.is_none()) {
    report = py::module_::import("cairn._progress").attr("reporter")(call.progress, name);
  }
  const bool reports = !report.is_none();

  std::stop_source stop;
  std::atomic<double> share = 0.0;
  Execution execution;
  execution.stop = stop.get_token();
  execution.seed = call.seed;
  if (reports) {
    execution.progress = [&share](double now) { share.store(now, std::memory_order_relaxed); };
  }
  std::mutex mutex;
  std::condition_variable changed;
  bool done = false;
  std::exception_ptr failure;
  std::optional<py::error_already_set> raised;
  {
    const py::gil_scoped_release released;
    std::thread worker([&] {
      std::exception_ptr thrown;
      try {
        execution.executor = Executor(call.threads);
        work(execution);
      } catch (...) {
        thrown = std::current_exception();
      }
      const std::lock_guard lock(mutex);
      failure = thrown;
      done = true;
      changed.notify_one();
    });
    std::unique_lock lock(mutex);
    while (!changed.wait_for(lock, kGlance, [&] { return done; })) {
      if (raised) continue;
      lock.unlock();
      {
        const py::gil_scoped_acquire acquired;
        try {
          if (PyErr_CheckSignals() != 0) throw py::error_already_set();
          if (reports) report(share.load(std::memory_order_relaxed));
        } catch (py::error_already_set& error) {
          raised.emplace(error);
          stop.request_stop();
        }
      }
      lock.lock();
    }
    lock.unlock();
    worker.join();
  }
  if (reports) {
    try {
      if (!raised && !failure) report(1.0);
      if (py::hasattr(report, "close")) report.attr("close")();
    } catch (py::error_already_set& error) {
      if (!raised) raised.emplace(error);
    }
  }
  if (raised) throw py::error_already_set(*raised);
  if (failure) std::rethrow_exception(failure);
}

py::array pose_arrays(const std::vector<Rigid3>& poses) {
  py::array_t<double> array(
      {static_cast<py::ssize_t>(poses.size()), py::ssize_t{4}, py::ssize_t{4}});
  double* out = array.mutable_data();
  for (const Rigid3& pose : poses) {
    const Matrix4d matrix = pose.matrix();
    for (int i = 0; i < 4; ++i) {
      for (int j = 0; j < 4; ++j) *out++ = matrix(i, j);
    }
  }
  return array;
}

py::array_t<double> real_array(py::handle value, std::string_view name,
                               const std::vector<py::ssize_t>& shape, Masked masked) {
  const py::array array = checked_array(value, name, shape, "fiub", "real numbers", masked);
  if (masked == Masked::kRefused || masked_entries(value) == 0) return cast_array<double>(array);
  const py::module_ ma = numpy_ma();
  return cast_array<double>(ma.attr("filled")(ma.attr("asarray")(value, "float64"),
                                              std::numeric_limits<double>::quiet_NaN()));
}

py::array_t<std::int64_t> integer_array(py::handle value, std::string_view name,
                                        const std::vector<py::ssize_t>& shape, Masked masked) {
  const py::array array = checked_array(value, name, shape, "iu", "integers", masked);
  if (array.dtype().kind() == 'u') {
    const auto wide = cast_array<std::uint64_t>(array);
    for (py::ssize_t i = 0; i < wide.size(); ++i) {
      if (wide.data()[i] > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max())) {
        throw Error(ErrorKind::kMisuse, fmt::format("{}[{}]", name, i),
                    fmt::format("{}", wide.data()[i]), "at most 2^63 - 1");
      }
    }
  }
  return cast_array<std::int64_t>(array);
}

py::array_t<std::uint64_t> id_array(py::handle value, std::string_view name,
                                    const std::vector<py::ssize_t>& shape) {
  const py::array array = checked_array(value, name, shape, "iu", "integers");
  if (array.dtype().kind() == 'i') {
    const auto with_signs = cast_array<std::int64_t>(array);
    for (py::ssize_t i = 0; i < with_signs.size(); ++i) {
      if (with_signs.data()[i] < 0) {
        throw Error(ErrorKind::kMisuse, fmt::format("{}[{}]", name, i),
                    fmt::format("{}", with_signs.data()[i]), "an integer that is not negative");
      }
    }
  }
  return cast_array<std::uint64_t>(array);
}

py::array_t<std::uint8_t> byte_array(py::handle value, std::string_view name,
                                     const std::vector<py::ssize_t>& shape, Masked masked) {
  const py::array array = checked_array(value, name, shape, "u", "bytes (uint8)", masked);
  if (array.dtype().char_() != 'B' && array.size() > 0) {
    throw py::type_error(fmt::format("{}: array of {}; expected bytes (uint8)", name,
                                     py::str(array.dtype()).cast<std::string>()));
  }
  return cast_array<std::uint8_t>(array);
}

py::array_t<bool> flag_array(py::handle value, std::string_view name,
                             const std::vector<py::ssize_t>& shape) {
  return cast_array<bool>(checked_array(value, name, shape, "b", "True and False"));
}

std::vector<std::uint8_t> known_rows(py::handle value, std::size_t count) {
  std::vector<std::uint8_t> known(count, 1);
  if (masked_entries(value) == 0) return known;
  const auto mask = cast_array<bool>(numpy_ma().attr("getmaskarray")(value));
  const auto size = static_cast<std::size_t>(mask.size());
  const std::size_t width = size / count;
  for (std::size_t i = 0; i < size; ++i) {
    if (mask.data()[i]) known[i / width] = 0;
  }
  return known;
}

std::vector<Eigen::Vector3d> positions_of(py::handle value, std::string_view name) {
  const auto array = real_array(value, name, {-1, 3});
  const auto count = static_cast<std::size_t>(array.shape(0));
  std::vector<Eigen::Vector3d> positions;
  detail::reserve_populated(positions, count);
  positions.resize(count);
  static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));
  if (!positions.empty()) std::copy_n(array.data(), 3 * positions.size(), positions.front().data());
  return positions;
}

namespace {

void require_finite(const Matrix4d& matrix, std::string_view name) {
  if (matrix.allFinite()) return;
  throw Error(ErrorKind::kMisuse, name, "a number that is not finite", "a 4x4 matrix of numbers");
}

}  // namespace

std::vector<Rigid3> rigids_of(py::handle value, std::string_view name) {
  const auto array = real_array(value, name, {-1, 4, 4});
  std::vector<Rigid3> poses;
  for (py::ssize_t i = 0; i < array.shape(0); ++i) {
    const Matrix4d matrix =
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(array.data() + 16 * i);
    const std::string where = fmt::format("{}[{}]", name, i);
    require_finite(matrix, where);
    try {
      poses.push_back(Rigid3::from_matrix(matrix));
    } catch (const Error& error) {
      throw Error(error.kind(), where, error.what(), "");
    }
  }
  return poses;
}

Similarity3 similarity_of(py::handle value, std::string_view name) {
  const Matrix4d matrix = matrix_of<4>(value, name);
  require_finite(matrix, name);
  return Similarity3::from_matrix(matrix);
}

Rigid3 rigid_of(py::handle value, std::string_view name) {
  const Similarity3 pose = similarity_of(value, name);
  refuse_if(std::abs(pose.scale() - 1.0) > 1e-9, name, fmt::format("scale {}", pose.scale()),
            "scale 1");
  return pose.rigid();
}

py::object to_python(double value) {
  if (std::isinf(value)) return py::none();
  return py::cast(value);
}

py::object to_python(const std::optional<double>& value) {
  if (!value) return py::none();
  return py::cast(*value);
}

void from_python(py::handle value, const std::string& name, bool& result) {
  const auto is_numpy = [&] {
    return py::isinstance(value, py::module_::import("numpy").attr("bool_"));
  };
  if (!py::isinstance<py::bool_>(value) && !is_numpy()) {
    throw py::type_error(fmt::format("{}: {}; expected True or False", name, type_name(value)));
  }
  result = PyObject_IsTrue(value.ptr()) == 1;
}

void from_python(py::handle value, const std::string& name, double& result) {
  if (value.is_none() && std::isinf(result)) return;  // None: stays unlimited, the default
  const bool is_text = py::isinstance<py::str>(value) || py::isinstance<py::bytes>(value);
  const double number = is_text ? -1.0 : PyFloat_AsDouble(value.ptr());
  if (is_text || (number == -1.0 && PyErr_Occurred() != nullptr)) {
    PyErr_Clear();
    throw py::type_error(fmt::format("{}: {}; expected a number", name, type_name(value)));
  }
  result = number;
}

void from_python(py::handle value, const std::string& name, std::string& result) {
  result = encoded(value, name);
}

void from_python(py::handle value, const std::string& name, std::optional<double>& result) {
  if (value.is_none()) {
    result.reset();
  } else {
    double number = 0.0;
    from_python(value, name, number);
    result = number;
  }
}

namespace {

// The integer value; throws for floats and text.
py::int_ index_of(py::handle value, const std::string& name) {
  PyObject* const index = PyNumber_Index(value.ptr());
  if (index == nullptr || py::isinstance<py::bool_>(value)) {
    PyErr_Clear();
    Py_XDECREF(index);
    throw py::type_error(fmt::format("{}: {}; expected an integer", name, type_name(value)));
  }
  return py::reinterpret_steal<py::int_>(index);
}

[[noreturn]] void refuse_range(const py::int_& value, const std::string& name,
                               const std::string& range) {
  throw Error(ErrorKind::kMisuse, name, std::string(py::str(static_cast<py::handle>(value))),
              range);
}

}  // namespace

std::int64_t integer_of(py::handle value, const std::string& name, std::int64_t least,
                        std::uint64_t most) {
  const py::int_ index = index_of(value, name);
  int overflow = 0;
  const long long number = PyLong_AsLongLongAndOverflow(index.ptr(), &overflow);
  if (overflow != 0 || number < least ||
      (number > 0 && static_cast<std::uint64_t>(number) > most)) {
    refuse_range(index, name, fmt::format("{} to {}", least, most));
  }
  return number;
}

std::uint64_t unsigned_of(py::handle value, const std::string& name, std::uint64_t most) {
  const py::int_ index = index_of(value, name);
  const unsigned long long number = PyLong_AsUnsignedLongLong(index.ptr());
  const bool failed = PyErr_Occurred() != nullptr;
  PyErr_Clear();
  if (failed || number > most) refuse_range(index, name, fmt::format("0 to {}", most));
  return number;
}

void refuse_keyword(const std::string& function, const std::string& name,
                    const std::vector<std::string>& names) {
  std::string text = fmt::format("{}() got an unexpected keyword argument '{}'", function, name);
  const py::list near = py::module_::import("difflib").attr("get_close_matches")(name, names, 1);
  if (!near.empty()) text += fmt::format("; did you mean '{}'?", near[0].cast<std::string>());
  throw py::type_error(text);
}

namespace {

// Makes objects like the base class. Because it is a different function, CPython refuses explicit calls of
// the base's __new__, so only calls of the class create objects, and these initialise them.
PyObject* make_object(PyTypeObject* type, PyObject* positional, PyObject* keywords) {
  PyTypeObject* base = type;
  while (base->tp_new == &make_object) base = base->tp_base;
  return base->tp_new(type, positional, keywords);
}

}  // namespace

void seal(py::module_& module) {
  for (const auto& [name, member] : module.attr("__dict__").cast<py::dict>()) {
    if (PyType_Check(member.ptr()) == 0) continue;
    auto* const type = reinterpret_cast<PyTypeObject*>(member.ptr());
    type->tp_new = &make_object;
    PyType_Modified(type);
  }
}

const char* kept(std::string text) {
  static std::deque<std::string> texts;
  return texts.emplace_back(std::move(text)).c_str();
}

}  // namespace cairn::python
