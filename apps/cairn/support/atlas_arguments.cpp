// SPDX-License-Identifier: BSD-3-Clause
#include "support/atlas_arguments.hpp"

#include <array>
#include <chrono>
#include <cmath>
#include <ctime>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/atlas/store/open_store.hpp"
#include "cairn/core/error.hpp"
#include "cairn/core/number_text.hpp"
#include "cairn/core/text.hpp"

#include "support/interrupt.hpp"
#include "support/link_documents.hpp"

namespace cairn::cli {
void AtlasArguments::add_to(const Command& command) {
  command.add_text("--atlas", location,
                   "Atlas: path of its file, or postgresql://user@host/database. Required",
                   "FILE|URL");
  command.add_flag("--insist", insist,
                   "Use the atlas even on a network file system, where locks may fail, or on a "
                   "server that confirms writes before they are on disk");
  add_number(command, "--wait", wait_s,
             "Longest wait for another process that writes to the atlas, seconds");
  common.add_to(command);
}

void AtlasArguments::add_at_to(const Command& command) {
  add_number(command, "--at", at, "Read the atlas as of this commit (default: the last)");
}

AtlasStoreOptions AtlasArguments::store_options(bool read_only) const {
  refuse_if(location.empty(), "--atlas", "not given", "an atlas");
  refuse_if(!(wait_s >= 0.0 && wait_s <= 1e6), "--wait", fmt::format("{}", wait_s),
            "0 to 1e6 seconds");
  AtlasStoreOptions options;
  options.read_only = read_only;
  options.insist = insist;
  options.wait = std::chrono::milliseconds(std::llround(1e3 * wait_s));
  set_author(options);
  options.stop = interrupt_requests();
  return options;
}

Atlas AtlasArguments::open() const {
  require_outputs(common);
  return Atlas::open(location, store_options(false));
}

Atlas AtlasArguments::open_to_read() const {
  const AtlasStoreOptions options = store_options(true);
  require_outputs(common);
  return Atlas::open(location, options);
}

std::string AtlasArguments::shown() const {
  return without_password(location);
}

std::optional<CommitId> AtlasArguments::commit() const {
  return at ? std::optional(CommitId{*at}) : std::nullopt;
}

Json AtlasArguments::head(const std::string& verb, Json options) const {
  options["at"] = to_json(at);
  return document("atlas_" + verb, common, {{"atlas", {{"path", shown()}}}}, std::move(options));
}

const AtlasNode& node_named(const AtlasState& state, const std::string& name,
                            const AtlasArguments& arguments) {
  if (const AtlasNode* const node = state.find(name)) return *node;
  if (name.starts_with('#')) {
    const auto id = parse_unsigned(std::string_view(name).substr(1));
    const auto found = id ? state.nodes.find(NodeId{*id}) : state.nodes.end();
    if (found != state.nodes.end()) return found->second;
  }
  std::vector<std::string> names;
  for (const auto& [id, node] : state.nodes) {
    if (names.size() < 8) names.push_back(node.name);
  }
  throw Error(ErrorKind::kMisuse, arguments.shown(), fmt::format("no map {}", printable(name)),
              names.empty() ? std::string("a map, but there is none")
                            : fmt::format("one of its maps: {}{}", fmt::join(names, ", "),
                                          names.size() < state.nodes.size() ? ", ..." : ""));
}

std::string time_text(std::int64_t time_ms) {
  const auto seconds = static_cast<std::time_t>(time_ms / 1000);
  std::tm parts = {};
  if (::gmtime_r(&seconds, &parts) == nullptr) return fmt::format("{} ms", time_ms);
  std::array<char, 64> text = {};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M:%S", &parts);
  return text.data();
}

Json to_json(const Link& link, const AtlasState& state) {
  const auto name_of = [&](NodeId id) {
    const auto node = state.nodes.find(id);
    return node == state.nodes.end() ? Json(nullptr) : Json(node->second.name);
  };
  const auto agrees = state.agrees.find(link.id);
  Json json = {{"id", link.id.value},
               {"target", name_of(link.target)},
               {"source", name_of(link.source)},
               {"kind", cairn::to_string(link.kind)},
               {"status", link.status()},
               {"probability", to_json(link.probability)},
               {"agrees", agrees == state.agrees.end() ? Json(nullptr) : Json(agrees->second)},
               {"reason", text_or_null(link.reason)}};
  add_pose(link, json);
  return json;
}

}  // namespace cairn::cli
