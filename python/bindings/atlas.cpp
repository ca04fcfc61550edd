// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/atlas.hpp"

#include <atomic>
#include <chrono>
#include <cmath>
#include <map>
#include <mutex>
#include <stop_token>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/atlas/export.hpp"
#include "cairn/atlas/queries.hpp"
#include "cairn/atlas/store/open_store.hpp"
#include "cairn/core/text.hpp"

#include "bindings/maps.hpp"
#include "bindings/merging.hpp"
#include "bindings/text.hpp"

namespace cairn::python {
namespace {

enum class OnInterrupt {
  kStopStore,  ///< also stop the store's statements
  kKeep,       ///< the store stays usable, so that the work can store its results
};

// An atlas that several Python threads may use; calls run one at a time.
class SharedAtlas {
 public:
  SharedAtlas(std::string location, AtlasStoreOptions options)
      : location_(std::move(location)), options_(std::move(options)) {}

  std::string name() const { return without_password(location_); }
  bool read_only() const { return options_.read_only; }
  bool is_closed() const { return closed_; }

  /// Calls `work(atlas, execution)` as run() does.
  template <class Work>
  void alone(const std::string& doing, const Work& work, const CallOptions& call = {},
             OnInterrupt on_interrupt = OnInterrupt::kStopStore) {
    run(doing, call, [&](const Execution& execution) {
      const std::unique_lock lock = locked(execution.stop);
      if (closed_) throw Error(ErrorKind::kMisuse, name(), "is closed", "an open atlas");
      if (!atlas_ || stop_.stop_requested()) open();
      const std::stop_callback stop(execution.stop, [&] {
        if (on_interrupt == OnInterrupt::kStopStore) stop_.request_stop();
      });
      atlas_->begin_run();
      work(*atlas_, execution);
    });
  }

  void close() {
    run("closing", {}, [&](const Execution& execution) {
      const std::unique_lock lock = locked(execution.stop);
      closed_ = true;
      atlas_.reset();
    });
  }

 private:
  std::unique_lock<std::timed_mutex> locked(const std::stop_token& stop) {
    std::unique_lock lock(mutex_, std::defer_lock);
    while (!lock.try_lock_for(std::chrono::milliseconds(20))) {
      if (stop.stop_requested()) throw Error(ErrorKind::kCancelled, name(), "stopped as asked", "");
    }
    return lock;
  }

  // Also reopens it after an interrupt, because a stop token cannot be reset.
  void open() {
    atlas_.reset();
    stop_ = std::stop_source();
    AtlasStoreOptions options = options_;
    options.stop = stop_.get_token();
    atlas_.emplace(Atlas::open(location_, options));
  }

  const std::string location_;
  const AtlasStoreOptions options_;
  std::timed_mutex mutex_;
  std::atomic<bool> closed_ = false;
  std::stop_source stop_;
  std::optional<Atlas> atlas_;
};

// --- What an atlas holds ----------------------------------------------------------------------------

struct HeldMap {
  AtlasNode node;
  std::optional<AtlasPose> pose;
  std::string frame;  ///< name of the map whose frame the pose is in
};

HeldMap held_map(const AtlasState& state, NodeId id) {
  HeldMap held{state.nodes.at(id), std::nullopt, {}};
  const auto pose = state.poses.find(id);
  if (pose != state.poses.end()) {
    held.pose = pose->second;
    held.frame = state.nodes.at(pose->second.frame).name;
  }
  return held;
}

const AtlasNode& node_named(Atlas& atlas, const AtlasState& state, const std::string& name) {
  if (const AtlasNode* const node = state.find(name)) return *node;
  std::vector<std::string> names;
  for (const auto& [id, node] : state.nodes) {
    if (names.size() < 8) names.push_back(node.name);
  }
  throw Error(ErrorKind::kMisuse, atlas.store().name(), fmt::format("no map {}", printable(name)),
              names.empty() ? std::string("a map, but there is none")
                            : fmt::format("one of its maps: {}{}", fmt::join(names, ", "),
                                          names.size() < state.nodes.size() ? ", ..." : ""));
}

NamedLink held_link(const AtlasState& state, const Link& link) {
  return {state.nodes.at(link.source).name, state.nodes.at(link.target).name, link,
          is_used(state, link)};
}

struct Route {
  AtlasRoute route;
  std::vector<std::string> maps;
  std::vector<NamedLink> links;
};

py::object text_or_none(const std::string& text) {
  if (text.empty()) return py::none();
  return decoded(text);
}

py::object utc_time(std::int64_t time_ms) {
  const py::module_ datetime = py::module_::import("datetime");
  return datetime.attr("datetime")
      .attr("fromtimestamp")(1e-3 * static_cast<double>(time_ms),
                             datetime.attr("timezone").attr("utc"));
}

// --- Making and opening -----------------------------------------------------------------------------

struct OpenKeywords {
  AtlasStoreOptions options;
  double wait_s = 1e-3 * static_cast<double>(AtlasStoreOptions().wait.count());
};

Keywords<OpenKeywords> keywords_to_create(const char* function) {
  Keywords<OpenKeywords> keywords(function);
  keywords.add("insist", [](auto& o) -> auto& { return o.options.insist; })
      .add("wait_s", [](auto& o) -> auto& { return o.wait_s; });
  return keywords;
}

const Keywords<OpenKeywords>& create_keywords() {
  static const auto table = keywords_to_create("create");
  return table;
}

const Keywords<OpenKeywords>& open_keywords() {
  static const auto table = [] {
    Keywords<OpenKeywords> keywords("open");
    keywords.add("read_only", [](auto& o) -> auto& { return o.options.read_only; })
        .add("insist", [](auto& o) -> auto& { return o.options.insist; })
        .add("wait_s", [](auto& o) -> auto& { return o.wait_s; });
    return keywords;
  }();
  return table;
}

const Keywords<OpenKeywords>& salvage_keywords() {
  static const auto table = keywords_to_create("salvage");
  return table;
}

AtlasStoreOptions store_options(OpenKeywords given) {
  if (!(given.wait_s >= 0.0 && given.wait_s <= 1e6)) {
    throw Error(ErrorKind::kMisuse, "wait_s", fmt::format("{}", given.wait_s), "0 to 1e6 seconds");
  }
  given.options.wait = std::chrono::milliseconds(std::llround(1e3 * given.wait_s));
  set_author(given.options);
  return given.options;
}

std::string location_of(const py::object& location) {
  auto path = py::module_::import("os").attr("fsencode")(location).cast<std::string>();
  if (path.empty() || path.find('\0') != std::string::npos) {
    throw Error(ErrorKind::kMisuse, "location", path.empty() ? "empty" : printable(path),
                "the path of a file, or postgresql://...");
  }
  return path;
}

std::shared_ptr<SharedAtlas> opened(const std::string& location, const AtlasStoreOptions& options) {
  auto atlas = std::make_shared<SharedAtlas>(location, options);
  atlas->alone("opening", [](Atlas&, const Execution&) {});
  return atlas;
}

std::shared_ptr<SharedAtlas> create_atlas(const py::object& where, const py::kwargs& given) {
  AtlasStoreOptions options = store_options(create_keywords().read(given));
  const std::string location = location_of(where);
  run("creating", {}, [&](const Execution& execution) {
    AtlasStoreOptions stoppable = options;
    stoppable.stop = execution.stop;
    Atlas::create(location, stoppable);
  });
  return opened(location, options);
}

std::shared_ptr<SharedAtlas> open_atlas(const py::object& where, const py::kwargs& given) {
  const AtlasStoreOptions options = store_options(open_keywords().read(given));
  return opened(location_of(where), options);
}

// --- Changes ----------------------------------------------------------------------------------------

HeldMap add(SharedAtlas& self, const LandmarkMap& map, const py::object& name,
            const py::object& session) {
  const std::string map_name = encoded(name, "name");
  const std::string map_session = session.is_none() ? "" : encoded(session, "session");
  HeldMap held;
  self.alone("adding", [&](Atlas& atlas, const Execution&) {
    const NodeId node = atlas.add(map, map_name, map_session).node;
    held = held_map(atlas.state(), node);
  });
  return held;
}

struct Lintable {
  AtlasLinkOptions options;
  std::optional<std::vector<std::string>> only;
};

const Keywords<Lintable>& link_keywords() {
  static const auto table = [] {
    Keywords<Lintable> keywords("link");
    keywords
        .add("only", py::none(),
             [](Lintable& call, py::handle value) {
               if (value.is_none()) return;
               if (py::isinstance<py::str>(value)) {
                 throw py::type_error("only: str; expected a sequence of names");
               }
               call.only.emplace();
               for (const py::handle name : value) call.only->push_back(encoded(name, "only"));
             })
        .add("retry", [](auto& c) -> auto& { return c.options.retry; })
        .add("candidates", [](auto& c) -> auto& { return c.options.links.candidates; })
        .add("shard", [](auto& c) -> auto& { return c.options.shard; })
        .add("shards", [](auto& c) -> auto& { return c.options.shards; })
        .add_table(LinkOptions::table, [](auto& c) -> auto& { return c.options.links; });
    return keywords;
  }();
  return table;
}

AtlasLinkResult link(SharedAtlas& self, const py::kwargs& given) {
  CallOptions call;
  Lintable keywords = link_keywords().read(given, &call);
  keywords.options.validate();
  AtlasLinkResult result;
  // For the library, an empty list means all pairs.
  if (keywords.only && keywords.only->empty()) return result;
  const auto work = [&](Atlas& atlas, const Execution& execution) {
    const AtlasState state = atlas.state();
    for (const std::string& name : keywords.only.value_or(std::vector<std::string>())) {
      keywords.options.only.push_back(node_named(atlas, state, name).id);
    }
    keywords.options.links.execution = execution;
    result = atlas.link(keywords.options);
  };
  self.alone("linking", work, call, OnInterrupt::kKeep);
  return result;
}

// From 6x6 numbers (without the scale) or 7x7.
Matrix7d covariance_of(py::handle value) {
  const auto given = py::array::ensure(value);
  PyErr_Clear();
  const py::ssize_t size = given && given.ndim() == 2 && given.shape(0) == 7 ? 7 : 6;
  const auto numbers = real_array(value, "covariance", {size, size});
  Matrix7d covariance = Matrix7d::Zero();
  for (py::ssize_t i = 0; i < size; ++i) {
    for (py::ssize_t j = 0; j < size; ++j) covariance(i, j) = numbers.at(i, j);
  }
  return covariance;
}

bool link_by_odometry(SharedAtlas& self, const py::object& target, const py::object& source,
                      const py::object& target_from_source, const py::object& covariance) {
  const std::string to = encoded(target, "target");
  const std::string from = encoded(source, "source");
  Link link;
  link.target_from_source = similarity_of(target_from_source, "target_from_source");
  const Matrix7d uncertainty = covariance_of(covariance);
  if (uncertainty(6, 6) > 0.0) {
    link.covariance_with_scale = uncertainty;
  } else {
    link.covariance = uncertainty.topLeftCorner<6, 6>();
  }
  std::size_t added = 0;
  self.alone("linking", [&](Atlas& atlas, const Execution&) {
    const AtlasState state = atlas.state();
    link.target = node_named(atlas, state, to).id;
    link.source = node_named(atlas, state, from).id;
    added = atlas.link_by_odometry(std::span(&link, 1));
  });
  return added > 0;
}

void link_manually(SharedAtlas& self, const py::object& target, const py::object& source,
                   const py::object& target_from_source, const py::object& covariance,
                   const py::object& reason) {
  const std::string to = encoded(target, "target");
  const std::string from = encoded(source, "source");
  const std::string why = encoded(reason, "reason");
  const Similarity3 pose = similarity_of(target_from_source, "target_from_source");
  const Matrix7d uncertainty = covariance_of(covariance);
  self.alone("linking", [&](Atlas& atlas, const Execution&) {
    const AtlasState state = atlas.state();
    atlas.link_manually(node_named(atlas, state, to).id, node_named(atlas, state, from).id, pose,
                        uncertainty, why);
  });
}

void unlink(SharedAtlas& self, const py::object& a, const py::object& b, const py::object& reason) {
  const std::string first = encoded(a, "a");
  const std::string second = encoded(b, "b");
  const std::string why = encoded(reason, "reason");
  self.alone("unlinking", [&](Atlas& atlas, const Execution&) {
    const AtlasState state = atlas.state();
    atlas.unlink(node_named(atlas, state, first).id, node_named(atlas, state, second).id, why);
  });
}

Keywords<PoseOptimisationOptions> pose_keywords(const char* function) {
  Keywords<PoseOptimisationOptions> keywords(function);
  keywords.add("agreement", [](auto& o) -> auto& { return o.agreement; })
      .add("max_iterations", [](auto& o) -> auto& { return o.max_iterations; });
  return keywords;
}

const Keywords<PoseOptimisationOptions>& optimize_keywords() {
  static const auto table = pose_keywords("optimize");
  return table;
}

const Keywords<PoseOptimisationOptions>& update_keywords() {
  static const auto table = pose_keywords("update_poses");
  return table;
}

AtlasOptimised compute_poses(SharedAtlas& self, const py::kwargs& given,
                             const Keywords<PoseOptimisationOptions>& keywords,
                             AtlasOptimised (Atlas::*compute)(const PoseOptimisationOptions&)) {
  CallOptions call;
  PoseOptimisationOptions options = keywords.read(given, &call);
  AtlasOptimised result;
  const auto work = [&](Atlas& atlas, const Execution& execution) {
    options.execution = execution;
    result = (atlas.*compute)(options);
  };
  self.alone("optimizing", work, call);
  return result;
}

AtlasOptimised optimize(SharedAtlas& self, const py::kwargs& given) {
  return compute_poses(self, given, optimize_keywords(), &Atlas::optimize);
}

AtlasOptimised update_poses(SharedAtlas& self, const py::kwargs& given) {
  return compute_poses(self, given, update_keywords(), &Atlas::update_poses);
}

void remove_map(SharedAtlas& self, const py::object& name) {
  const std::string map = encoded(name, "name");
  self.alone("removing", [&](Atlas& atlas, const Execution&) {
    atlas.remove(node_named(atlas, atlas.state(), map).id);
  });
}

py::list split_map(SharedAtlas& self, const py::object& name, const py::object& frames) {
  const std::string map = encoded(name, "name");
  std::size_t count = 0;
  from_python(frames, "frames", count);
  std::vector<std::string> names;
  self.alone("splitting", [&](Atlas& atlas, const Execution&) {
    const std::vector<NodeId> parts = atlas.split(node_named(atlas, atlas.state(), map).id, count);
    const AtlasState state = atlas.state();
    for (const NodeId id : parts) names.push_back(state.nodes.at(id).name);
  });
  return decoded(names);
}

struct CompactKeywords {
  std::uint64_t keep = kKeptCommits;
  bool dry = false;
};

const Keywords<CompactKeywords>& compact_keywords() {
  static const auto table = [] {
    Keywords<CompactKeywords> keywords("compact");
    keywords.add("keep", [](auto& o) -> auto& { return o.keep; }).add("dry", [](auto& o) -> auto& {
      return o.dry;
    });
    return keywords;
  }();
  return table;
}

AtlasCompaction compact(SharedAtlas& self, const py::kwargs& given) {
  const CompactKeywords keywords = compact_keywords().read(given);
  AtlasCompaction result;
  self.alone("compacting", [&](Atlas& atlas, const Execution&) {
    result = atlas.store().compact(keywords.keep, keywords.dry);
  });
  return result;
}

std::uint64_t undo(SharedAtlas& self, const py::object& commit) {
  std::optional<std::uint64_t> which;
  from_python(commit, "commit", which);
  CommitId undone;
  self.alone("undoing", [&](Atlas& atlas, const Execution&) {
    undone = atlas.undo(which ? std::optional(CommitId{*which}) : std::nullopt);
  });
  return undone.value;
}

// --- Reading ----------------------------------------------------------------------------------------

py::dict maps_of(SharedAtlas& self) {
  std::vector<HeldMap> held;
  self.alone("reading", [&](Atlas& atlas, const Execution&) {
    const AtlasState state = atlas.state();
    for (const auto& [id, node] : state.nodes) held.push_back(held_map(state, id));
  });
  py::dict maps;
  for (HeldMap& map : held) {
    const py::str name = decoded(map.node.name);
    maps[name] = std::move(map);
  }
  return maps;
}

std::vector<NamedLink> links_of(SharedAtlas& self) {
  std::vector<NamedLink> links;
  self.alone("reading", [&](Atlas& atlas, const Execution&) {
    const AtlasState state = atlas.state();
    for (const auto& [id, link] : state.links) links.push_back(held_link(state, link));
  });
  return links;
}

std::vector<AtlasCommit> log_of(SharedAtlas& self) {
  std::vector<AtlasCommit> log;
  self.alone("reading", [&](Atlas& atlas, const Execution&) { log = atlas.store().log(); });
  return log;
}

SharedMap map_named(SharedAtlas& self, const py::object& name) {
  const std::string map_name = encoded(name, "name");
  SharedMap map;
  self.alone("reading", [&](Atlas& atlas, const Execution&) {
    const AtlasState state = atlas.state();
    map = std::make_shared<LandmarkMap>(atlas.map(node_named(atlas, state, map_name)));
  });
  return map;
}

std::optional<Route> path_between(SharedAtlas& self, const py::object& target,
                                  const py::object& source) {
  const std::string to = encoded(target, "target");
  const std::string from = encoded(source, "source");
  std::optional<Route> path;
  self.alone("reading", [&](Atlas& atlas, const Execution&) {
    const AtlasState state = atlas.state();
    const auto found =
        find_route(state, node_named(atlas, state, to).id, node_named(atlas, state, from).id);
    if (!found) return;
    path.emplace(Route{*found, {}, {}});
    for (const NodeId id : found->nodes) path->maps.push_back(state.nodes.at(id).name);
    for (const LinkId id : found->links) {
      path->links.push_back(held_link(state, state.links.at(id)));
    }
  });
  return path;
}

py::list verify(SharedAtlas& self) {
  AtlasVerification found;
  self.alone("verifying", [&](Atlas& atlas, const Execution&) { found = atlas.store().verify(); });
  return decoded(found.problems);
}

// Keywords that select a component of an atlas and a commit.
struct Selection {
  std::optional<std::string> frame;
  std::optional<std::uint64_t> at;

  AtlasState state(Atlas& atlas) const {
    return atlas.state(at ? std::optional(CommitId{*at}) : std::nullopt);
  }
};

void set_frame(Selection& selection, py::handle value) {
  if (!value.is_none()) selection.frame = encoded(value, "frame");
}

const Keywords<Selection>& export_keywords() {
  static const auto table = [] {
    Keywords<Selection> keywords("export");
    keywords.add("frame", py::none(), set_frame).add("at", [](auto& o) -> auto& { return o.at; });
    return keywords;
  }();
  return table;
}

void export_to(SharedAtlas& self, const std::filesystem::path& path, const py::kwargs& given) {
  const Selection selection = export_keywords().read(given);
  export_of(path);  // throws before the work if the ending is unknown
  std::vector<std::string> remarks;
  self.alone("exporting", [&](Atlas& atlas, const Execution&) {
    const AtlasState state = selection.state(atlas);
    AtlasExportOptions options;
    if (selection.frame) options.frame = node_named(atlas, state, *selection.frame).id;
    options.log = [&](std::string_view remark) { remarks.emplace_back(remark); };
    export_atlas(atlas, state, path, options);
  });
  warn(remarks);
}

struct WorldKeywords : Selection {
  ChangeOptions changes;
};

const Keywords<WorldKeywords>& world_keywords() {
  static const auto table = [] {
    Keywords<WorldKeywords> keywords("world_difference");
    keywords.add("at", [](auto& o) -> auto& { return o.at; })
        .add("min_observations", [](auto& o) -> auto& { return o.changes.min_observations; })
        .add("tolerance", [](auto& o) -> auto& { return o.changes.tolerance; })
        .add("reach", [](auto& o) -> auto& { return o.changes.reach; })
        .add("min_landmarks", [](auto& o) -> auto& { return o.changes.min_landmarks; })
        .add("min_size", [](auto& o) -> auto& { return o.changes.min_size; })
        .add("min_confidence", [](auto& o) -> auto& { return o.changes.min_confidence; })
        .add("seed", [](auto& o) -> auto& { return o.changes.seed; });
    return keywords;
  }();
  return table;
}

struct WorldDifference {
  ChangeResult result;
  std::string frame;  ///< name of the map whose frame the places are in
};

WorldDifference difference_of_worlds(SharedAtlas& self, const py::object& first,
                                     const py::object& second, const py::kwargs& given) {
  const std::string before = encoded(first, "first");
  const std::string after = encoded(second, "second");
  CallOptions call;
  WorldKeywords keywords = world_keywords().read(given, &call);
  keywords.changes.validate();
  WorldDifference found;
  const auto work = [&](Atlas& atlas, const Execution& execution) {
    const AtlasState state = keywords.state(atlas);
    const auto side = [&](const std::string& name) {
      std::vector<NodeId> nodes = placed_of_session(state, name);
      if (nodes.empty()) nodes.push_back(node_named(atlas, state, name).id);
      return nodes;
    };
    const std::vector<NodeId> nodes = side(before);
    keywords.changes.execution = execution;
    found.result = world_difference(atlas, state, nodes, side(after), keywords.changes);
    found.frame = state.nodes.at(state.poses.at(nodes.front()).frame).name;
  };
  self.alone("comparing", work, call);
  return found;
}

AtlasSalvage salvage(const py::object& damaged, const py::object& location,
                     const py::kwargs& given) {
  AtlasStoreOptions options = store_options(salvage_keywords().read(given));
  const std::string from = location_of(damaged);
  const std::string to = location_of(location);
  AtlasSalvage result;
  run("salvaging", {}, [&](const Execution& execution) {
    options.stop = execution.stop;
    result = salvage_store(from, to, options);
  });
  return result;
}

struct MergeKeywords : Selection {
  MergePlacedOptions placed;
};

const Keywords<MergeKeywords>& atlas_merge_keywords() {
  static const auto table = [] {
    Keywords<MergeKeywords> keywords("merge");
    keywords.add("frame", py::none(), set_frame).add("at", [](auto& c) -> auto& { return c.at; });
    add_merge_placed_to(keywords, [](auto& c) -> auto& { return c.placed; });
    keywords.add("seed", [](auto& c) -> auto& { return c.placed.fusion.seed; });
    return keywords;
  }();
  return table;
}

Merged merge_atlas(SharedAtlas& self, const py::kwargs& given) {
  CallOptions call;
  const MergeKeywords keywords = atlas_merge_keywords().read(given, &call);
  keywords.placed.validate();
  Merged merged;
  std::vector<std::string> remarks;
  const auto work = [&](Atlas& atlas, const Execution& execution) {
    const AtlasState state = keywords.state(atlas);
    MergePlacedOptions options = keywords.placed;
    std::optional<NodeId> frame;
    if (keywords.frame) frame = node_named(atlas, state, *keywords.frame).id;
    options.fusion.execution = execution;
    options.fusion.log = [&](std::string_view remark) { remarks.emplace_back(remark); };
    for (const auto& [id, node] : state.nodes) merged.names.push_back(node.name);
    merged.result = atlas.merge(options, frame, state.commit);
    merged.map = std::make_shared<LandmarkMap>(*std::exchange(merged.result.map, std::nullopt));
  };
  self.alone("merging", work, call);
  warn(remarks);
  return merged;
}

// --- Classes ----------------------------------------------------------------------------------------

std::string held_map_text(const HeldMap& self) {
  return fmt::format("<AtlasMap {}: {} landmarks, {} frames, {}>", self.node.name,
                     self.node.landmarks, self.node.frames,
                     self.pose ? "in the frame of " + self.frame : "not placed");
}

void bind_contents(py::module_& module) {
  py::class_<HeldMap>(module, "AtlasMap",
                      "Description of a map in an atlas at the time of the call. Atlas.map() gives "
                      "the map itself.")
      .def_property_readonly("name", [](const HeldMap& self) { return decoded(self.node.name); })
      .def_property_readonly(
          "session", [](const HeldMap& self) { return text_or_none(self.node.session); },
          "Name shared by the maps of one run; None if unknown.")
      .def_property_readonly(
          "length_unit",
          [](const HeldMap& self) { return std::string(to_string(self.node.length_unit)); },
          "'metres' or 'free'.")
      .def_property_readonly("landmarks", [](const HeldMap& self) { return self.node.landmarks; })
      .def_property_readonly("frames", [](const HeldMap& self) { return self.node.frames; })
      .def_property_readonly("observations",
                             [](const HeldMap& self) { return self.node.observations; })
      .def_property_readonly(
          "frame",
          [](const HeldMap& self) { return text_or_none(self.pose ? self.frame : std::string()); },
          "Name of the map whose frame frame_from_map refers to, the same for all maps of a "
          "group;\nNone without a pose.")
      .def_property_readonly(
          "frame_from_map",
          [](const HeldMap& self) -> py::object {
            if (!self.pose) return py::none();
            return pose_array(self.pose->frame_from_node);
          },
          "4x4, including the scale; None until optimize() has placed the map.")
      .def_property_readonly(
          "covariance",
          [](const HeldMap& self) -> py::object {
            if (!self.pose) return py::none();
            return copied_matrix(self.pose->covariance);
          },
          "(7, 7), of the left perturbation (dt, dphi, dlog s) in `frame`; None without a pose.")
      .def("__repr__", [](const HeldMap& self) { return decoded(held_map_text(self)); });
  py::class_<AtlasCommit>(module, "AtlasCommit", "A change of an atlas.")
      .def_property_readonly("id", [](const AtlasCommit& self) { return self.id.value; })
      .def_property_readonly(
          "time", [](const AtlasCommit& self) { return utc_time(self.time_ms); },
          "A datetime, in UTC.")
      .def_property_readonly("author",
                             [](const AtlasCommit& self) { return text_or_none(self.author); })
      .def_property_readonly("host",
                             [](const AtlasCommit& self) { return text_or_none(self.host); })
      .def_property_readonly(
          "verb", [](const AtlasCommit& self) { return decoded(self.verb); },
          "'add', 'link' and so on.")
      .def_property_readonly(
          "text", [](const AtlasCommit& self) { return decoded(self.text); },
          "Description of the change, for people.")
      .def_property_readonly(
          "run", [](const AtlasCommit& self) { return self.run.value; },
          "Id of the first commit of the same call.")
      .def_property_readonly(
          "undoes",
          [](const AtlasCommit& self) {
            return self.undoes ? std::optional(self.undoes->value) : std::nullopt;
          },
          "Id of the last commit of the call that this commit undid; None if it undid none.")
      .def("__repr__", [](const AtlasCommit& self) {
        return decoded(
            fmt::format("<AtlasCommit {}: {}: {}>", self.id.value, self.verb, self.text));
      });
  py::class_<Route>(module, "AtlasRoute", "A chain of links from one map of an atlas to another.")
      .def_property_readonly(
          "maps", [](const Route& self) { return decoded(self.maps); },
          "Names of the maps, from the target to the source.")
      .def_readonly("links", &Route::links, "Links between consecutive maps.")
      .def_property_readonly(
          "target_from_source",
          [](const Route& self) { return pose_array(self.route.target_from_source); },
          "4x4, along the links.")
      .def_property_readonly(
          "covariance", [](const Route& self) { return matrix_or_none(self.route.covariance); },
          "(7, 7), of the left perturbation (dt, dphi, dlog s) in the target frame; None if a link "
          "has none.")
      .def_property_readonly(
          "optimised", [](const Route& self) { return pose_array(self.route.optimised); },
          "4x4: target_from_source from the optimised poses, which use all links; None unless "
          "both\n"
          "maps are in one frame.")
      .def("__repr__", [](const Route& self) {
        return decoded(fmt::format("<AtlasRoute: {}>", fmt::join(self.maps, " <- ")));
      });
}

py::tuple box_of(const ChangedPlace& place) {
  return py::make_tuple(copied_matrix(place.low), copied_matrix(place.high));
}

std::string world_text(const WorldDifference& self) {
  std::map<ChangeKind, std::size_t> counts;
  for (const Change& change : self.result.changes) ++counts[change.kind];
  return fmt::format("<WorldDifference: {} moved, {} vanished, {} appeared>",
                     counts[ChangeKind::kMoved], counts[ChangeKind::kVanished],
                     counts[ChangeKind::kAppeared]);
}

void bind_world(py::module_& module) {
  py::class_<ChangedPlace>(module, "ChangedPlace", "Position of a changed object in one map.")
      .def_property_readonly(
          "landmarks", [](const ChangedPlace& self) { return self.landmarks.size(); },
          "Number of the object's landmarks there.")
      .def_property_readonly("position",
                             [](const ChangedPlace& self) { return copied_matrix(self.centre); })
      .def_property_readonly(
          "box", [](const ChangedPlace& self) { return box_of(self); },
          "Lowest and highest corner of a box around nearly all its landmarks.")
      .def("__repr__", [](const ChangedPlace& self) {
        return fmt::format("<ChangedPlace: {} landmarks at ({:.2f}, {:.2f}, {:.2f})>",
                           self.landmarks.size(), self.centre.x(), self.centre.y(),
                           self.centre.z());
      });
  py::class_<Change>(module, "Change", "An object that appeared, vanished or moved.")
      .def_property_readonly(
          "kind", [](const Change& self) { return std::string(to_string(self.kind)); },
          "'moved', 'vanished' or 'appeared'.")
      .def_readonly("before", &Change::before, "None if the object appeared.")
      .def_readonly("after", &Change::after, "None if the object vanished.")
      .def_property_readonly(
          "after_from_before",
          [](const Change& self) { return pose_array(self.after_from_before); },
          "4x4: motion of a moved object; None for other changes.")
      .def_readonly("confidence", &Change::confidence, "Probability that it is a change, 0 to 1.")
      .def("__repr__", [](const Change& self) {
        return fmt::format("<Change: {}, confidence {:.3f}>", to_string(self.kind),
                           self.confidence);
      });
  py::class_<WorldDifference>(module, "WorldDifference",
                              "Differences between two sessions or maps of an atlas.")
      .def_property_readonly(
          "changes", [](const WorldDifference& self) { return self.result.changes; },
          "Moved, vanished, appeared; each by descending confidence.")
      .def_property_readonly(
          "comparable",
          [](const WorldDifference& self) {
            return py::make_tuple(self.result.comparable_first, self.result.comparable_second);
          },
          "Number of landmarks of the first and of the second that the other should also have; (0, "
          "0) if\nno keyframe of either observed the other's landmarks.")
      .def_property_readonly(
          "found_again", [](const WorldDifference& self) { return self.result.repeated; },
          "Share of the comparable landmarks that the other has.")
      .def_property_readonly(
          "frame", [](const WorldDifference& self) { return decoded(self.frame); },
          "Name of the map whose frame the positions are in.")
      .def("__repr__", &world_text);
}

void bind_results(py::module_& module) {
  py::class_<AtlasCompaction>(module, "AtlasCompaction", "Numbers of what Atlas.compact() dropped.")
      .def_readonly("commits", &AtlasCompaction::commits, "Number of commits joined into one.")
      .def_readonly("maps", &AtlasCompaction::maps)
      .def_readonly("map_bytes", &AtlasCompaction::map_bytes)
      .def_readonly("links", &AtlasCompaction::links)
      .def_readonly("poses", &AtlasCompaction::poses)
      .def("__repr__", [](const AtlasCompaction& self) {
        return fmt::format("<AtlasCompaction: {} commits, {} maps, {} links, {} poses>",
                           self.commits, self.maps, self.links, self.poses);
      });
  py::class_<AtlasSalvage>(module, "AtlasSalvage", "Numbers of what Atlas.salvage() copied.")
      .def_readonly("maps", &AtlasSalvage::maps)
      .def_readonly("links", &AtlasSalvage::links)
      .def_readonly("poses", &AtlasSalvage::poses)
      .def_property_readonly(
          "lost", [](const AtlasSalvage& self) { return decoded(self.lost); },
          "One sentence for each loss.")
      .def("__repr__", [](const AtlasSalvage& self) {
        return fmt::format("<AtlasSalvage: {} maps, {} links, {} poses; {} lost>", self.maps,
                           self.links, self.poses, self.lost.size());
      });
  py::class_<AtlasLinkResult>(module, "AtlasLinkResult", "Numbers of pairs of Atlas.link().")
      .def_readonly("pairs", &AtlasLinkResult::pairs, "Pairs of maps in the atlas.")
      .def_readonly("tried", &AtlasLinkResult::tried, "Pairs tried by this call.")
      .def_readonly("tried_before", &AtlasLinkResult::tried_before,
                    "Pairs tried before, or linked by a person.")
      .def_readonly("not_likely", &AtlasLinkResult::not_likely, "Pairs excluded by recognition.")
      .def_readonly("aligned", &AtlasLinkResult::aligned, "Pairs aligned by this call.")
      .def("__repr__", [](const AtlasLinkResult& self) {
        return fmt::format(
            "<AtlasLinkResult: {} of {} pairs tried, {} aligned; {} tried before, {} not likely>",
            self.tried, self.pairs, self.aligned, self.tried_before, self.not_likely);
      });
  py::class_<AtlasOptimised>(module, "AtlasOptimised", "Result of Atlas.optimize().")
      .def_readonly("placed", &AtlasOptimised::placed, "Number of maps with a pose.")
      .def_readonly("contradicted", &AtlasOptimised::contradicted,
                    "Number of aligned links that disagree with the poses and are not used.")
      .def_readonly("changed", &AtlasOptimised::changed, "Whether the call changed the atlas.")
      .def_property_readonly("commit", [](const AtlasOptimised& self) { return self.commit.value; })
      .def("__repr__", [](const AtlasOptimised& self) {
        return fmt::format("<AtlasOptimised: {} maps placed, {} links contradicted>", self.placed,
                           self.contradicted);
      });
}

using AtlasClass = py::class_<SharedAtlas, std::shared_ptr<SharedAtlas>>;

void bind_changes(AtlasClass& atlas) {
  atlas
      .def("add", &add, py::arg("map"), py::arg("name"), py::kw_only(),
           py::arg("session") = py::none(),
           "add($self, map, name, *, session=None)\n--\n\n"
           "Adds a map and returns its description. If the atlas already has the same map, under "
           "any name,\n"
           "changes nothing and returns that one.\n\n"
           "session        name shared by the maps of one run")
      .def("link", &link,
           kept(link_keywords().signature("$self") +
                "Aligns pairs of maps that were not tried yet and stores each result at once, "
                "aligned or not.\n"
                "After an interrupt, another call continues.\n\n"
                "only           names: try only pairs with one of these maps\n"
                "retry          also try pairs that were tried and not aligned\n"
                "candidates     number of other maps to try each map with, the likeliest; 0: all.\n"
                "               None: all in an atlas of up to 32 maps, otherwise 10\n"
                "shard, shards  for several processes that share the pairs of a file: this one "
                "tries\n"
                "               every shards-th pair, from shard"))
      .def("link_by_odometry", &link_by_odometry, py::arg("target"), py::arg("source"),
           py::arg("target_from_source"), py::arg("covariance"),
           "link_by_odometry($self, target, source, target_from_source, covariance)\n--\n\n"
           "Links two maps of one run by odometry. Returns False, without a change, if they have "
           "an odometry link.\n\n"
           "covariance     (6, 6), of the left perturbation (dt, dphi) in the target frame; or\n"
           "               (7, 7), with dlog s")
      .def("link_manually", &link_manually, py::arg("target"), py::arg("source"),
           py::arg("target_from_source"), py::arg("covariance"), py::kw_only(),
           py::arg("reason") = "",
           "link_manually($self, target, source, target_from_source, covariance, *, "
           "reason='')\n--\n\n"
           "Links two maps by a person's statement; replaces an earlier one.\n\n"
           "covariance     as for link_by_odometry()\n"
           "reason         one sentence for people")
      .def("unlink", &unlink, py::arg("a"), py::arg("b"), py::kw_only(), py::arg("reason") = "",
           "unlink($self, a, b, *, reason='')\n--\n\n"
           "Replaces the links between two maps by the statement that they are not linked. link() "
           "does not\ntry the pair again.")
      .def("optimize", &optimize,
           kept(optimize_keywords().signature("$self") +
                "Computes the poses of all maps with aligned links, each group in the frame of its "
                "first map.\n"
                "Does not use links that disagree with the others.\n\n"
                "agreement      largest displacement of a map between two poses that agree, as a\n"
                "               share of its radius"))
      .def(
          "update_poses", &update_poses,
          kept(update_keywords().signature("$self") +
               "Like optimize(), but of the largest group it computes only poses near the maps and "
               "links that were added\n"
               "since: for a SLAM system that adds maps while it drives. Computes all poses if "
               "anything else was changed."))
      .def("remove", &remove_map, py::arg("name"),
           "remove($self, name)\n--\n\n"
           "Removes a map, its links and its pose, and the poses in its frame.")
      .def("split", &split_map, py::arg("name"), py::arg("frames"),
           "split($self, name, frames)\n--\n\n"
           "Splits a map into maps of `frames` keyframes each, linked by their poses in it. "
           "Removes its own\nlinks. Returns the names of the new maps.")
      .def("compact", &compact,
           kept(compact_keywords().signature("$self", false) +
                "Joins the oldest commits into one and drops data that no remaining commit needs. "
                "Cannot be undone.\n\n"
                "keep           number of commits that remain\n"
                "dry            only report what would be dropped"))
      .def("undo", &undo, py::arg("commit") = py::none(),
           "undo($self, commit=None)\n--\n\n"
           "Undoes all changes of the call that this commit belongs to; None: of the last call "
           "that is not\n"
           "undone. Returns the id of the commit that was undone.");
}

void bind_reading(AtlasClass& atlas) {
  atlas
      .def_property_readonly("maps", &maps_of,
                             "Dict of AtlasMap by name, in the order in which they were added.")
      .def_property_readonly("links", &links_of, "Links of all pairs that were tried or stated.")
      .def_property_readonly("log", &log_of, "All commits, oldest first.")
      .def("map", &map_named, py::arg("name"), "map($self, name)\n--\n\nThe map, in its own frame.")
      .def("path", &path_between, py::arg("target"), py::arg("source"),
           "path($self, target, source)\n--\n\n"
           "The chain of aligned links between two maps with the most certain transform; None if "
           "no chain\nconnects them.")
      .def("merge", &merge_atlas,
           kept(atlas_merge_keywords().signature("$self") +
                "Merges the maps of one group into one map, in the frame of the first. Does not "
                "change the atlas.\n"
                "The result also describes the maps that were left out.\n\n"
                "frame          name of a map of the group; None: the largest group\n"
                "at             id of a commit: use the atlas as it was after it\n"
                "straighten     straighten maps that others show to be bent\n"
                "adjust         optimise all keyframes and landmarks (bundle adjustment); warns if "
                "the maps\n"
                "               lack the data"))
      .def(
          "export", &export_to, py::arg("path"),
          kept(
              export_keywords().signature("$self, path", false) +
              "Exports the atlas to other programs, in the format of the path's ending. Warns of "
              "what is\n"
              "left out.\n\n"
              ".g2o, .json    the graph of links and poses\n"
              ".tum           the keyframes of one group of maps\n"
              ".ply           the landmarks of one group, not fused\n"
              ".mcap          the maps and links of one group, for Foxglove, Lichtblick and rerun\n"
              "none           a folder: every map as .cairn, and the graph\n\n"
              "frame, at      as for merge()"))
      .def("world_difference", &difference_of_worlds, py::arg("first"), py::arg("second"),
           kept(world_keywords().signature("$self, first, second") +
                "Finds objects that appeared, vanished or moved between two sessions or maps in "
                "one frame.\n"
                "Lengths are in the maps' unit.\n\n"
                "first, second  names of sessions; if there is no such session, of maps\n"
                "at             id of a commit: use the atlas as it was after it\n"
                "tolerance      largest distance of two landmarks that are the same\n"
                "reach          largest distance of neighbouring landmarks of one object\n"
                "min_size       least length of an object's longest side\n"
                "min_confidence least confidence of a reported object"))
      .def("verify", &verify,
           "verify($self)\n--\n\nReads and checks all data. Returns one sentence for each damage "
           "found.");
}

}  // namespace

void bind_atlas(py::module_& module) {
  bind_contents(module);
  bind_results(module);
  bind_world(module);
  AtlasClass atlas(
      module, "Atlas",
      "Maps, their relative poses and the history of both, in a file or a PostgreSQL database.\n\n"
      "Every change is a commit, which is on disk when the call returns. Several threads may use "
      "one object;\n"
      "it executes one call at a time. Other processes open the same location separately. Use it "
      "in a `with`\n"
      "statement, or call close().");
  atlas
      .def_static("create", &create_atlas, py::arg("location"),
                  kept(create_keywords().signature("location", false) +
                       "Creates an empty atlas and opens it.\n\n"
                       "location       path of a file, or URL of a database "
                       "('postgresql://user@host/name')\n"
                       "insist         allow a network file system, or a server that confirms "
                       "writes before\n"
                       "               they are on its disk\n"
                       "wait_s         longest wait for another process that writes"))
      .def_static("open", &open_atlas, py::arg("location"),
                  kept(open_keywords().signature("location", false) +
                       "Opens an existing atlas.\n\n"
                       "read_only      also works in a read-only folder\n"
                       "insist, wait_s as for create()"))
      .def_static("salvage", &salvage, py::arg("damaged"), py::arg("location"),
                  kept(salvage_keywords().signature("damaged, location", false) +
                       "Copies the undamaged maps, and the last links and poses between them, to a "
                       "new atlas, without\n"
                       "the history. Does not change the damaged atlas.\n\n"
                       "damaged        path of a file\n"
                       "location       path of the new one"))
      .def_property_readonly(
          "location", [](const SharedAtlas& self) { return decoded(self.name()); },
          "Without the password, if it is a URL.")
      .def_property_readonly("read_only", &SharedAtlas::read_only)
      .def("close", &SharedAtlas::close,
           "close($self)\n--\n\nCloses the atlas after waiting for a call in another thread. "
           "Closing again has no effect.")
      .def("__enter__", [](const std::shared_ptr<SharedAtlas>& self) { return self; })
      .def("__exit__", [](SharedAtlas& self, const py::args&) { self.close(); })
      .def("__repr__", [](const SharedAtlas& self) {
        return decoded(fmt::format("<Atlas {}{}{}>", self.name(),
                                   self.read_only() ? ", read-only" : "",
                                   self.is_closed() ? ", closed" : ""));
      });
  bind_changes(atlas);
  bind_reading(atlas);
}

}  // namespace cairn::python
