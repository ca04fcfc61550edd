// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "cairn/core/file.hpp"

// ZIP archives of arrays.
namespace cairn::detail {

/// The unpacked members of an archive by name.
/// @param where place for error messages
/// @throws Error (input) for an archive that is damaged, split, encrypted or compressed by a method other
///         than deflate, or whose members unpack to more than memory_budget() of the archive
std::map<std::string, std::string> read_zip(std::string_view archive, const std::string& where);

/// Writes an archive member by member, uncompressed.
class ZipWriter {
 public:
  explicit ZipWriter(const ByteSink& sink) : sink_(sink) {}

  /// @throws Error (misuse) if the archive grows beyond 4 GiB
  void add(std::string_view name, std::string_view content);
  void finish();

 private:
  void write(const std::string& bytes);

  const ByteSink& sink_;
  std::uint64_t offset_ = 0;
  std::string directory_;
  std::uint16_t members_ = 0;
};

}  // namespace cairn::detail
