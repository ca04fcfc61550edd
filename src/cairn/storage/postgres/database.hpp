// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <stop_token>
#include <string>

#include "cairn/storage/database.hpp"

namespace cairn::postgres {

struct OpenOptions {
  bool read_only = false;
  /// Longest wait for another process's lock.
  std::chrono::milliseconds lock_timeout{30'000};
  /// Waiting for a lock ends with an Error (cancelled) soon after stop was requested.
  std::stop_token stop = {};
  /// First schema of the search path; need not exist.
  std::string schema = {};
};

using storage::Statement;
using storage::Transaction;

/// A connection to a PostgreSQL database. All rows of a statement are fetched at once. Writing
/// transactions wait for each other and do not block readers.
class Database : public storage::Database {
 public:
  /// @param name in messages, e.g. without_password(url)
  /// @throws Error (storage) if the connection fails
  Database(const std::string& url, std::string name, const OpenOptions& options = {});
};

}  // namespace cairn::postgres
