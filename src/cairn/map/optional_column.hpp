// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <iterator>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace cairn {

/// Column of optional values, stored as an array of values and an array of flags for known values.
/// Reads and writes like a vector of std::optional, but returns entries by value.
template <class Value>
class OptionalColumn {
 public:
  using value_type = std::optional<Value>;

  /// Proxy for a writable entry.
  class Entry {
   public:
    // NOLINTNEXTLINE(google-explicit-constructor): reads as the value it stands for
    operator value_type() const { return std::as_const(column_)[index_]; }
    const Entry& operator=(const value_type& value) const {
      column_.set(index_, value);
      return *this;
    }
    const Entry& operator=(const Entry& other) const { return *this = value_type(other); }
    Entry(const Entry&) = default;
    ~Entry() = default;

    bool has_value() const { return value_type(*this).has_value(); }
    explicit operator bool() const { return has_value(); }
    /// The value; it must be known.
    const Value& operator*() const { return column_.values_[index_]; }
    const Value* operator->() const { return &column_.values_[index_]; }
    Value value() const { return value_type(*this).value(); }
    void reset() const { column_.set(index_, std::nullopt); }

    friend bool operator==(const Entry& entry, const value_type& value) {
      return value_type(entry) == value;
    }

   private:
    friend OptionalColumn;
    Entry(OptionalColumn& column, std::size_t index) : column_(column), index_(index) {}

    OptionalColumn& column_;
    std::size_t index_;
  };

  class Iterator {
   public:
    using iterator_category = std::input_iterator_tag;
    using value_type = std::optional<Value>;
    using difference_type = std::ptrdiff_t;
    using reference = value_type;
    using pointer = void;

    Iterator() = default;
    value_type operator*() const { return (*column_)[index_]; }
    Iterator& operator++() {
      ++index_;
      return *this;
    }
    Iterator operator++(int) {
      Iterator before = *this;
      ++index_;
      return before;
    }
    friend bool operator==(const Iterator&, const Iterator&) = default;

   private:
    friend OptionalColumn;
    Iterator(const OptionalColumn& column, std::size_t index) : column_(&column), index_(index) {}

    const OptionalColumn* column_ = nullptr;
    std::size_t index_ = 0;
  };

  OptionalColumn() = default;
  OptionalColumn(std::initializer_list<value_type> entries)
      : OptionalColumn(entries.begin(), entries.end()) {}
  template <std::input_iterator Input>
  OptionalColumn(Input begin, Input end) {
    for (; begin != end; ++begin) push_back(*begin);
  }
  explicit OptionalColumn(std::size_t size, const value_type& value = std::nullopt) {
    assign(size, value);
  }

  std::size_t size() const { return values_.size(); }
  bool empty() const { return values_.empty(); }
  value_type operator[](std::size_t i) const {
    return known_[i] != 0 ? value_type(values_[i]) : std::nullopt;
  }
  Entry operator[](std::size_t i) { return {*this, i}; }
  value_type front() const { return (*this)[0]; }
  value_type back() const { return (*this)[size() - 1]; }
  Entry front() { return (*this)[0]; }
  Entry back() { return (*this)[size() - 1]; }
  Iterator begin() const { return {*this, 0}; }
  Iterator end() const { return {*this, size()}; }

  /// One per row; zero if unknown.
  std::span<const Value> values() const { return values_; }
  /// One per row: 1 if the value is known, else 0.
  std::span<const std::uint8_t> known() const { return known_; }

  void set(std::size_t i, const value_type& value) {
    values_[i] = value.value_or(placeholder());
    known_[i] = value ? 1 : 0;
  }
  void push_back(const value_type& value) {
    values_.push_back(value.value_or(placeholder()));
    known_.push_back(value ? 1 : 0);
  }
  template <class... Arguments>
  void emplace_back(Arguments&&... arguments) {
    push_back(value_type(std::forward<Arguments>(arguments)...));
  }
  void pop_back() {
    values_.pop_back();
    known_.pop_back();
  }
  void assign(std::size_t size, const value_type& value) {
    values_.assign(size, value.value_or(placeholder()));
    known_.assign(size, value ? 1 : 0);
  }
  /// @param value value of the new rows
  void resize(std::size_t size, const value_type& value = std::nullopt) {
    values_.resize(size, value.value_or(placeholder()));
    known_.resize(size, value ? 1 : 0);
  }
  void reserve(std::size_t size) {
    values_.reserve(size);
    known_.reserve(size);
  }
  void clear() {
    values_.clear();
    known_.clear();
  }
  void shrink_to_fit() {
    values_.shrink_to_fit();
    known_.shrink_to_fit();
  }

  friend bool operator==(const OptionalColumn&, const OptionalColumn&) = default;

 private:
  // Stored value of an unknown entry. Eigen's default constructor leaves matrices uninitialised.
  static Value placeholder() {
    if constexpr (requires { Value::Zero(); }) {
      return Value::Zero();
    } else {
      return Value();
    }
  }

  std::vector<Value> values_;
  std::vector<std::uint8_t> known_;
};

}  // namespace cairn
