// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "cairn/core/error.hpp"
#include "cairn/core/log.hpp"

namespace cairn::testing {

/// The message of the error that `act` throws, which must be of that kind; empty if it throws none.
template <class Act>
std::string refusal(ErrorKind kind, const Act& act) {
  try {
    act();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), kind) << error.what();
    return error.what();
  }
  return {};
}

/// The same, where it is a failure that none is thrown.
template <class Act>
std::string message_of(ErrorKind kind, const Act& act) {
  std::string message = refusal(kind, act);
  EXPECT_NE(message, "") << "no Error";
  return message;
}

/// What reading and writing log.
struct Remarks {
  std::vector<std::string> texts;
  std::vector<std::string> losses;  ///< those of the texts that are losses

  LogSink sink() {
    return [this](const Remark& remark) {
      texts.emplace_back(remark.text);
      if (remark.kind == RemarkKind::kLoss) losses.emplace_back(remark.text);
    };
  }
  void clear() { *this = {}; }
};

}  // namespace cairn::testing
