// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stop_token>
#include <string>
#include <string_view>

#include <sqlite3.h>

namespace cairn::sqlite::detail {

/// State that statements share with their database.
struct Connection {
  std::string name;
  sqlite3* handle = nullptr;
  std::stop_token stop;
  bool untrusted = true;

  /// @throws cairn::Error for SQLite's error `code`, always
  /// @param doing the failed action, e.g. the statement
  [[noreturn]] void fail(int code, std::string_view doing) const;
};

}  // namespace cairn::sqlite::detail
