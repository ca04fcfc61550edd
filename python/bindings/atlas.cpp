// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/atlas/atlas.hpp"

#include <atomic>
#include <chrono>
#include <cmath>
#include <mutex>
#include <stop_token>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "cairn/atlas/export.hpp"
#include "cairn/atlas/queries.hpp"
#include "cairn/atlas/store/open_store.hpp"
#include "cairn/core/text.hpp"

#include "bindings/atlas_results.hpp"
#include "bindings/maps.hpp"
#include "bindings/properties.hpp"
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

  /// What `work(atlas)` returns.
  template <class Work>
  auto ask(const std::string& doing, const Work& work) {
    std::optional<std::invoke_result_t<Work, Atlas&>> answer;
    alone(doing, [&](Atlas& atlas, const Execution&) { answer.emplace(work(atlas)); });
    return *std::move(answer);
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

// --- Making and opening -----------------------------------------------------------------------------

struct OpenKeywords {
  AtlasStoreOptions options;
  double wait_s = 1e-3 * static_cast<double>(AtlasStoreOptions().wait.count());
};

Keywords<OpenKeywords> keywords_to_create(const char* function) {
  return Keywords<OpenKeywords>(function)
      .add("insist", [](auto& o) -> auto& { return o.options.insist; })
      .add("wait_s", [](auto& o) -> auto& { return o.wait_s; });
}

Keywords<OpenKeywords> open_keywords() {
  return Keywords<OpenKeywords>("open")
      .add("read_only", [](auto& o) -> auto& { return o.options.read_only; })
      .add("insist", [](auto& o) -> auto& { return o.options.insist; })
      .add("wait_s", [](auto& o) -> auto& { return o.wait_s; });
}

AtlasStoreOptions store_options(OpenKeywords given) {
  refuse_if(!(given.wait_s >= 0.0 && given.wait_s <= 1e6), "wait_s",
            fmt::format("{}", given.wait_s), "0 to 1e6 seconds");
  given.options.wait = std::chrono::milliseconds(std::llround(1e3 * given.wait_s));
  set_author(given.options);
  return given.options;
}

std::string location_of(const py::object& location) {
  auto path = py::module_::import("os").attr("fsencode")(location).cast<std::string>();
  refuse_if(path.empty() || path.find('\0') != std::string::npos, "location",
            path.empty() ? "empty" : printable(path), "the path of a file, or postgresql://...");
  return path;
}

std::shared_ptr<SharedAtlas> opened(const std::string& location, const AtlasStoreOptions& options) {
  auto atlas = std::make_shared<SharedAtlas>(location, options);
  atlas->alone("opening", [](Atlas&, const Execution&) {});
  return atlas;
}

std::shared_ptr<SharedAtlas> create_atlas(const py::object& where, const py::kwargs& given) {
  AtlasStoreOptions options = store_options(keywords_to_create("create").read(given));
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
  return self.ask("adding", [&](Atlas& atlas) {
    const NodeId node = atlas.add(map, map_name, map_session).node;
    return held_map(atlas.state(), node);
  });
}

struct Lintable {
  AtlasLinkOptions options;
  std::optional<std::vector<std::string>> only;
};

Keywords<Lintable> link_keywords() {
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
      .add("shard", [](auto& c) -> auto& { return c.options.shard; })
      .add("shards", [](auto& c) -> auto& { return c.options.shards; })
      .add_table(LinkOptions::table, [](auto& c) -> auto& { return c.options.links; })
      .add_seed();
  return keywords;
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
    result = atlas.link(keywords.options, execution);
  };
  self.alone("linking", work, call, OnInterrupt::kKeep);
  return result;
}

// From 6x6 numbers (without the scale) or 7x7.
Matrix7d covariance_of(py::handle value) {
  const auto given = py::array::ensure(value);
  PyErr_Clear();
  if (given && given.ndim() == 2 && given.shape(0) == 7) return matrix_of<7>(value, "covariance");
  Matrix7d covariance = Matrix7d::Zero();
  covariance.topLeftCorner<6, 6>() = matrix_of<6>(value, "covariance");
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
  return self.ask("linking", [&](Atlas& atlas) {
    const AtlasState state = atlas.state();
    link.target = node_named(atlas, state, to).id;
    link.source = node_named(atlas, state, from).id;
    return atlas.link_by_odometry(std::span(&link, 1)) > 0;
  });
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
  return Keywords<PoseOptimisationOptions>(function).add_table(PoseOptimisationOptions::table,
                                                               [](auto& o) -> auto& { return o; });
}

AtlasOptimised compute_poses(SharedAtlas& self, const py::kwargs& given,
                             const Keywords<PoseOptimisationOptions>& keywords,
                             AtlasOptimised (Atlas::*compute)(const PoseOptimisationOptions&)) {
  CallOptions call;
  const PoseOptimisationOptions options = keywords.read(given, &call);
  AtlasOptimised result;
  const auto work = [&](Atlas& atlas, const Execution&) { result = (atlas.*compute)(options); };
  self.alone("optimizing", work, call);
  return result;
}

AtlasOptimised optimize(SharedAtlas& self, const py::kwargs& given) {
  return compute_poses(self, given, pose_keywords("optimize"), &Atlas::optimize);
}

AtlasOptimised update_poses(SharedAtlas& self, const py::kwargs& given) {
  return compute_poses(self, given, pose_keywords("update_poses"), &Atlas::update_poses);
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
  return decoded(self.ask("splitting", [&](Atlas& atlas) {
    const std::vector<NodeId> parts = atlas.split(node_named(atlas, atlas.state(), map).id, count);
    const AtlasState state = atlas.state();
    std::vector<std::string> names;
    for (const NodeId id : parts) names.push_back(state.nodes.at(id).name);
    return names;
  }));
}

struct CompactKeywords {
  std::uint64_t keep = kKeptCommits;
  bool dry = false;
};

Keywords<CompactKeywords> compact_keywords() {
  Keywords<CompactKeywords> keywords("compact");
  keywords.add("keep", [](auto& o) -> auto& { return o.keep; }).add("dry", [](auto& o) -> auto& {
    return o.dry;
  });
  return keywords;
}

AtlasCompaction compact(SharedAtlas& self, const py::kwargs& given) {
  const CompactKeywords keywords = compact_keywords().read(given);
  return self.ask("compacting",
                  [&](Atlas& atlas) { return atlas.store().compact(keywords.keep, keywords.dry); });
}

std::uint64_t undo(SharedAtlas& self, const py::object& commit) {
  std::optional<std::uint64_t> which;
  from_python(commit, "commit", which);
  return self.ask("undoing", [&](Atlas& atlas) {
    return atlas.undo(which ? std::optional(CommitId{*which}) : std::nullopt).value;
  });
}

// --- Reading ----------------------------------------------------------------------------------------

py::dict maps_of(SharedAtlas& self) {
  py::dict maps;
  for (HeldMap& map : self.ask("reading", [](Atlas& atlas) {
         const AtlasState state = atlas.state();
         std::vector<HeldMap> held;
         for (const auto& [id, node] : state.nodes) held.push_back(held_map(state, id));
         return held;
       })) {
    const py::str name = decoded(map.node.name);
    maps[name] = std::move(map);
  }
  return maps;
}

std::vector<NamedLink> links_of(SharedAtlas& self) {
  return self.ask("reading", [](Atlas& atlas) {
    const AtlasState state = atlas.state();
    std::vector<NamedLink> links;
    for (const auto& [id, link] : state.links) links.push_back(held_link(state, link));
    return links;
  });
}

std::vector<AtlasCommit> log_of(SharedAtlas& self) {
  return self.ask("reading", [](Atlas& atlas) { return atlas.store().log(); });
}

SharedMap map_named(SharedAtlas& self, const py::object& name) {
  const std::string map_name = encoded(name, "name");
  return self.ask("reading", [&](Atlas& atlas) {
    const AtlasState state = atlas.state();
    return std::make_shared<LandmarkMap>(atlas.map(node_named(atlas, state, map_name)));
  });
}

std::optional<Route> path_between(SharedAtlas& self, const py::object& target,
                                  const py::object& source) {
  const std::string to = encoded(target, "target");
  const std::string from = encoded(source, "source");
  return self.ask("reading", [&](Atlas& atlas) -> std::optional<Route> {
    const AtlasState state = atlas.state();
    const auto found =
        find_route(state, node_named(atlas, state, to).id, node_named(atlas, state, from).id);
    if (!found) return std::nullopt;
    Route path{*found, {}, {}};
    for (const NodeId id : found->nodes) path.maps.push_back(state.nodes.at(id).name);
    for (const LinkId id : found->links) path.links.push_back(held_link(state, state.links.at(id)));
    return path;
  });
}

py::list verify(SharedAtlas& self) {
  return decoded(
      self.ask("verifying", [](Atlas& atlas) { return atlas.store().verify(); }).problems);
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

Keywords<Selection> export_keywords() {
  return Keywords<Selection>("export")
      .add("frame", py::none(), set_frame)
      .add("at", [](auto& o) -> auto& { return o.at; });
}

void export_to(SharedAtlas& self, const std::filesystem::path& path, const py::kwargs& given) {
  const Selection selection = export_keywords().read(given);
  export_of(path);  // throws before the work if the ending is unknown
  std::vector<std::string> remarks;
  self.alone("exporting", [&](Atlas& atlas, const Execution&) {
    const AtlasState state = selection.state(atlas);
    std::optional<NodeId> frame;
    if (selection.frame) frame = node_named(atlas, state, *selection.frame).id;
    export_atlas(atlas, state, path, frame,
                 [&](std::string_view remark) { remarks.emplace_back(remark); });
  });
  warn(remarks);
}

struct WorldKeywords : Selection {
  ChangeOptions changes;
};

Keywords<WorldKeywords> world_keywords() {
  return Keywords<WorldKeywords>("world_difference")
      .add("at", [](auto& o) -> auto& { return o.at; })
      .add_table(ChangeOptions::table, [](auto& o) -> auto& { return o.changes; })
      .add_seed();
}

WorldDifference difference_of_worlds(SharedAtlas& self, const py::object& first,
                                     const py::object& second, const py::kwargs& given) {
  const std::string before = encoded(first, "first");
  const std::string after = encoded(second, "second");
  CallOptions call;
  const WorldKeywords keywords = world_keywords().read(given, &call);
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
    found.result = world_difference(atlas, state, nodes, side(after), keywords.changes, execution);
    found.frame = state.nodes.at(state.poses.at(nodes.front()).frame).name;
  };
  self.alone("comparing", work, call);
  return found;
}

AtlasSalvage salvage(const py::object& damaged, const py::object& location,
                     const py::kwargs& given) {
  AtlasStoreOptions options = store_options(keywords_to_create("salvage").read(given));
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
  FusionOptions fusion;
};

Keywords<MergeKeywords> atlas_merge_keywords() {
  Keywords<MergeKeywords> keywords("merge");
  keywords.add("frame", py::none(), set_frame).add("at", [](auto& c) -> auto& { return c.at; });
  keywords
      .add_table(FusionOptions::table, [](auto& c) -> auto& { return c.fusion; }, {"drop_floaters"})
      .add_seed();
  return keywords;
}

Merged merge_atlas(SharedAtlas& self, const py::kwargs& given) {
  CallOptions call;
  const MergeKeywords keywords = atlas_merge_keywords().read(given, &call);
  keywords.fusion.validate();
  Merged merged;
  std::vector<std::string> remarks;
  const auto work = [&](Atlas& atlas, Execution execution) {
    const AtlasState state = keywords.state(atlas);
    std::optional<NodeId> frame;
    if (keywords.frame) frame = node_named(atlas, state, *keywords.frame).id;
    execution.log = [&](std::string_view remark) { remarks.emplace_back(remark); };
    for (const auto& [id, node] : state.nodes) merged.names.push_back(node.name);
    merged.result = atlas.merge(keywords.fusion, frame, state.commit, execution);
    merged.map = std::make_shared<LandmarkMap>(*std::exchange(merged.result.map, std::nullopt));
  };
  self.alone("merging", work, call);
  warn(remarks);
  return merged;
}

// --- The class --------------------------------------------------------------------------------------

using AtlasClass = Exposed<SharedAtlas, std::shared_ptr<SharedAtlas>>;

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
           "an odometry link\n"
           "or a manual link, also that of unlink().\n\n"
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
           kept(pose_keywords("optimize").signature("$self") +
                "Computes the poses of all maps with aligned links, each group in the frame of its "
                "first map.\n"
                "Does not use links that disagree with the others.\n\n"
                "agreement      largest displacement of a map between two poses that agree, as a\n"
                "               share of its radius"))
      .def(
          "update_poses", &update_poses,
          kept(pose_keywords("update_poses").signature("$self") +
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
                "thin_splats    leave out duplicates of Gaussian splats of lower opacity\n"
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
  bind_atlas_results(module);
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
                  kept(keywords_to_create("create").signature("location", false) +
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
                  kept(keywords_to_create("salvage").signature("damaged, location", false) +
                       "Copies the undamaged maps, and the last links and poses between them, to a "
                       "new atlas, without\n"
                       "the history. Does not change the damaged atlas.\n\n"
                       "damaged        path of a file\n"
                       "location       path of the new one"))
      .get("location", "Without the password, if it is a URL.", &SharedAtlas::name)
      .get("read_only", "", &SharedAtlas::read_only)
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
