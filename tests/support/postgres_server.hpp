// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <system_error>

#include <pwd.h>
#include <unistd.h>

#include "support/temporary_folder.hpp"

namespace cairn::testing {

/// A PostgreSQL server of its own, from Debian's package, which listens on a socket in a temporary folder
/// and ends with this object. Started as user postgres if this is root, which the server refuses to be.
class PostgresServer {
 public:
  /// Why no server can be started here; std::nullopt if one can.
  static std::optional<std::string> missing() {
    if (!std::filesystem::exists(kPrograms + "initdb")) {
      return "no PostgreSQL server in " + kPrograms + " (Debian's package postgresql-15)";
    }
    if (::geteuid() == 0 && ::getpwnam("postgres") == nullptr) {
      return "this is root, and there is no user postgres to run the server";
    }
    return std::nullopt;
  }

  /// @param settings more of the server's settings, such as "fsync=off"
  explicit PostgresServer(const std::string& settings = {}) {
    if (::geteuid() == 0) {
      const passwd* const user = ::getpwnam("postgres");
      if (::chown(folder_.path().c_str(), user->pw_uid, user->pw_gid) != 0) {
        throw std::runtime_error("chown failed");
      }
    }
    run("initdb", "-D " + data() + " -U cairn -A trust -N -E UTF8 --locale=C");
    std::string options = "-k " + folder_.path().string() + " -h ''";
    if (!settings.empty()) options += " -c " + settings;
    run("pg_ctl", "-D " + data() + " -w -l " + data() + "/log -o \"" + options + "\" start");
  }
  ~PostgresServer() {
    try {
      run("pg_ctl", "-D " + data() + " -w -m immediate stop");
    } catch (const std::runtime_error&) {
      // The folder goes, and with it the server's reason to be.
    }
  }

  std::string url(const std::string& database = "postgres") const {
    return "postgresql:///" + database + "?user=cairn&host=" + folder_.path().string();
  }

  /// Ends every process of the server at once, as a power loss would, and starts it again.
  void crash() {
    run("pg_ctl", "-D " + data() + " -w -m immediate stop");
    run("pg_ctl", "-D " + data() + " -w -l " + data() + "/log -o \"-k " + folder_.path().string() +
                      " -h ''\" start");
  }

 private:
  static inline const std::string kPrograms = "/usr/lib/postgresql/15/bin/";

  std::string data() const { return (folder_ / "data").string(); }
  void run(const std::string& program, const std::string& arguments) const {
    const std::string as = ::geteuid() == 0 ? "runuser -u postgres -- " : "";
    const std::string log = (folder_ / "commands.log").string();
    const std::string command = "cd " + folder_.path().string() + " && " + as + kPrograms +
                                program + " " + arguments + " >>" + log + " 2>&1 </dev/null";
    if (std::system(command.c_str()) != 0) {
      throw std::runtime_error(program + " failed:\n" + read_text(log));
    }
  }

  // In memory where there is room: no test cuts the power, and a server waits for its disk at each commit.
  static std::filesystem::path place() {
    const std::filesystem::path memory = "/dev/shm";
    constexpr std::uintmax_t kEnough = std::uintmax_t{1} << 29U;
    std::error_code error;
    const std::uintmax_t room = std::filesystem::space(memory, error).available;
    const bool fits = !error && room >= kEnough && ::access(memory.c_str(), W_OK) == 0;
    return fits ? memory : std::filesystem::temp_directory_path();
  }

  TemporaryFolder folder_{place()};
};

}  // namespace cairn::testing
