// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "bindings/maps.hpp"
#include "bindings/support.hpp"
#include "bindings/text.hpp"

/// Properties of the library's results.
namespace cairn::python {

/// What Python sees of a value: text decoded, enumerators by their names, ids as numbers; poses, matrices and vectors of
/// numbers as arrays, with NaN for unknown numbers; None for std::nullopt.
template <class Value>
py::object seen(const Value& value) {
  if constexpr (std::is_base_of_v<py::object, Value>) {
    return value;
  } else if constexpr (std::is_same_v<Value, std::string> ||
                       std::is_same_v<Value, std::vector<std::string>>) {
    return decoded(value);
  } else if constexpr (std::is_enum_v<Value>) {
    return py::cast(std::string(to_string(value)));
  } else if constexpr (std::is_same_v<Value, Rigid3> || std::is_same_v<Value, Similarity3>) {
    return copied_matrix(value.matrix());
  } else if constexpr (std::is_base_of_v<Eigen::MatrixBase<Value>, Value>) {
    return copied_matrix(value);
  } else if constexpr (std::is_same_v<Value, std::vector<double>> ||
                       std::is_same_v<Value, std::vector<float>>) {
    return copied(value);
  } else if constexpr (std::is_same_v<Value, std::vector<std::optional<double>>>) {
    std::vector<double> numbers;
    for (const auto& number : value) {
      numbers.push_back(number.value_or(std::numeric_limits<double>::quiet_NaN()));
    }
    return copied(numbers);
  } else if constexpr (requires { value.has_value(); }) {
    if (!value) return py::none();
    return seen(*value);
  } else if constexpr (requires { value.value; }) {
    return py::cast(value.value);
  } else {
    return py::cast(value);
  }
}

/// What Python sees at the end of a path of members or functions, of each the next; None behind a std::nullopt.
template <class Owner, class First, class... Rest>
py::object seen_at(const Owner& owner, const First& first, const Rest&... rest) {
  const auto& value = std::invoke(first, owner);
  if constexpr (sizeof...(Rest) == 0) {
    return seen(value);
  } else if constexpr (requires { value.has_value(); }) {
    if (!value) return py::none();
    return seen_at(*value, rest...);
  } else {
    return seen_at(value, rest...);
  }
}

/// A step of a path: how many there are.
inline constexpr auto kSize = [](const auto& all) { return all.size(); };

/// A class of Python with properties that Python sees as seen() says.
template <class Class, class... Holder>
class Exposed : public py::class_<Class, Holder...> {
  using Base = py::class_<Class, Holder...>;

 public:
  using Base::Base;

  /// @param path as of seen_at(), e.g. &AtlasRoute::covariance
  template <class... Path>
  Exposed& get(const char* name, const char* what, const Path&... path) {
    Base::def_property_readonly(
        name, [path...](const Class& self) { return seen_at(self, path...); }, what);
    return *this;
  }

  template <class... Arguments>
  Exposed& def(Arguments&&... arguments) {
    Base::def(std::forward<Arguments>(arguments)...);
    return *this;
  }
  template <class... Arguments>
  Exposed& def_static(Arguments&&... arguments) {
    Base::def_static(std::forward<Arguments>(arguments)...);
    return *this;
  }
  template <class... Arguments>
  Exposed& def_readonly(Arguments&&... arguments) {
    Base::def_readonly(std::forward<Arguments>(arguments)...);
    return *this;
  }
  template <class... Arguments>
  Exposed& def_property_readonly(Arguments&&... arguments) {
    Base::def_property_readonly(std::forward<Arguments>(arguments)...);
    return *this;
  }
};

}  // namespace cairn::python
