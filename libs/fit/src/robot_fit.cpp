#include "hamelin/fit/robot_fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>

#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/description/urdf_geometry.hpp"
#include "hamelin/fit/mesh.hpp"
#include "hamelin/fit/solid.hpp"
#include "hamelin/io/file.hpp"

namespace hamelin::fit {

namespace {

using Eigen::Vector3d;
namespace fs = std::filesystem;

bool is_file(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

std::string without_scheme(const std::string& text, const std::string& scheme) {
  return text.rfind(scheme, 0) == 0 ? text.substr(scheme.size()) : "";
}

// The geometry of one link, which its shapes must cover.
struct LinkSolid {
  std::string name;
  std::size_t triangles = 0;
  std::vector<Shape> balls;      // spheres of the URDF, kept unchanged
  std::unique_ptr<Solid> solid;  // all other geometry; null if there is none

  [[nodiscard]] double volume() const {
    double volume = solid ? solid->volume() : 0.0;
    if (!solid && !balls.empty()) volume = excess(nullptr, balls, balls).volume_m3;
    return volume;
  }
};

class GeometryReader {
 public:
  GeometryReader(const fs::path& urdf, const FitOptions& options, std::vector<std::string>& notes)
      : urdf_(urdf), options_(options), notes_(notes) {}

  std::vector<LinkSolid> read() {
    std::vector<LinkSolid> solids;
    std::vector<std::string> without_geometry, by_visual;
    for (const description::LinkGeometry& link : description::read_urdf_geometry(urdf_)) {
      const bool visual = link.collision.empty() && !link.visual.empty() && options_.visual;
      const auto& shapes = visual ? link.visual : link.collision;
      if (shapes.empty()) {
        without_geometry.push_back(link.name + (link.visual.empty() ? "" : " (has <visual>)"));
        continue;
      }
      if (visual) by_visual.push_back(link.name);
      solids.push_back(solid_of(link.name, shapes));
    }
    const auto joined = [](const std::vector<std::string>& names) {
      return fmt::format("{}", fmt::join(names, ", "));
    };
    if (!by_visual.empty())
      notes_.push_back("taken from <visual> because there is no <collision>: " + joined(by_visual));
    if (!without_geometry.empty())
      notes_.push_back("no geometry and therefore no shapes: " + joined(without_geometry));
    if (solids.empty())
      throw Error(
          ErrorCode::invalid,
          fmt::format("{}: no link has a <collision>, expected at least one{}", urdf_.string(),
                      options_.visual ? "" : " (--visual takes <visual> instead)"));
    return solids;
  }

 private:
  LinkSolid solid_of(const std::string& name, const std::vector<description::LinkShape>& shapes) {
    LinkSolid out;
    out.name = name;
    Mesh all;
    for (const description::LinkShape& shape : shapes) {
      switch (shape.kind) {
        case description::LinkShape::Kind::sphere:
          out.balls.push_back({shape.pose.p(), shape.pose.p(), shape.radius_m});
          break;
        case description::LinkShape::Kind::box:
          append(all, box_mesh(shape.size_m), shape.pose);
          break;
        case description::LinkShape::Kind::cylinder:
          append(all, cylinder_mesh(shape.radius_m, shape.length_m), shape.pose);
          break;
        case description::LinkShape::Kind::mesh:
          append(all, mesh_of(name, shape), shape.pose);
          break;
      }
      if (all.triangles.size() > triangles_max)
        throw Error(ErrorCode::invalid,
                    fmt::format("{}: link '{}': more than {} triangles, expected coarser meshes",
                                urdf_.string(), name, triangles_max));
    }
    out.triangles = all.triangles.size();
    if (all.triangles.empty()) return out;
    try {
      out.solid = std::make_unique<Solid>(std::move(all));
    } catch (const Error& e) {
      throw Error(e.code(), fmt::format("{}: link '{}': {}", urdf_.string(), name, e.what()));
    }
    if (!out.solid->closed())
      notes_.push_back(fmt::format(
          "link '{}': its mesh is not closed; the winding number decides what is inside", name));
    return out;
  }

  Mesh mesh_of(const std::string& name, const description::LinkShape& shape) const {
    const std::string place =
        fmt::format("{}: line {}: link '{}'", urdf_.string(), shape.line, name);
    std::vector<fs::path> tried;
    const auto file = find_mesh(shape.mesh, urdf_, options_.meshes, &tried);
    if (!file) {
      std::string tried_paths;
      constexpr std::size_t shown = 3;
      for (std::size_t i = 0; i < std::min(tried.size(), shown); ++i)
        tried_paths += (i == 0 ? "" : ", ") + tried[i].string();
      if (tried.size() > shown) tried_paths += fmt::format(" and {} more", tried.size() - shown);
      throw Error(
          ErrorCode::io,
          fmt::format("{}: no file for mesh '{}', tried {}; --package NAME=DIR and --meshes DIR "
                      "add folders with meshes",
                      place, shape.mesh, tried_paths));
    }
    try {
      return load_mesh(*file, shape.scale);
    } catch (const Error& e) {
      throw Error(e.code(), fmt::format("{}: {}", place, e.what()));
    }
  }

  const fs::path& urdf_;
  const FitOptions& options_;
  std::vector<std::string>& notes_;
};

LinkFit measured(const LinkSolid& link, std::vector<Shape> shapes, double tolerance_m) {
  LinkFit out;
  out.name = link.name;
  out.triangles = link.triangles;
  out.closed = !link.solid || link.solid->closed();
  out.shapes = std::move(shapes);
  const auto merge_gap = [&](const Gap& gap) {
    if (gap.found_m > out.gap.found_m) out.gap.point = gap.point;
    out.gap.found_m = std::max(out.gap.found_m, gap.found_m);
    out.gap.bound_m = std::max(out.gap.bound_m, gap.bound_m);
  };
  if (link.solid) merge_gap(coverage_gap(link.solid->mesh(), out.shapes, tolerance_m));
  for (const Shape& ball : link.balls) {
    const bool is_covered = std::any_of(
        out.shapes.begin(), out.shapes.end(),
        [&](const Shape& shape) { return distance(shape, ball.from) + ball.radius_m <= 1e-12; });
    if (!is_covered)
      merge_gap(coverage_gap(ball_mesh(ball.from, ball.radius_m), out.shapes, tolerance_m));
  }
  out.excess = excess(link.solid.get(), link.balls, out.shapes);
  out.volume_m3 = link.volume();
  return out;
}

std::vector<Shape> shapes_for(const LinkSolid& link, const CoverOptions& options) {
  std::vector<Shape> shapes = link.balls;
  if (link.solid) {
    const Cover found = cover(*link.solid, link.balls, options);
    shapes.insert(shapes.end(), found.shapes.begin(), found.shapes.end());
  }
  return shapes;
}

Json numbers(const Vector3d& v) {
  return Json::array({v.x(), v.y(), v.z()});
}

Vector3d vector_of(const Json& list) {
  return {list[0].get<double>(), list[1].get<double>(), list[2].get<double>()};
}

}  // namespace

std::optional<fs::path> find_mesh(const std::string& name, const fs::path& urdf,
                                  const MeshPlaces& places, std::vector<fs::path>* tried) {
  std::optional<fs::path> found;
  const auto try_path = [&](const fs::path& path) {
    const fs::path plain = resolve_path({}, path);
    if (tried != nullptr && std::find(tried->begin(), tried->end(), plain) == tried->end())
      tried->push_back(plain);
    if (!is_file(plain)) return false;
    found = plain;
    return true;
  };
  const fs::path here = urdf.parent_path();
  fs::path rest = name;
  for (const char* scheme : {"package://", "model://"}) {
    const std::string inner = without_scheme(name, scheme);
    if (inner.empty()) continue;
    rest = inner;
    const fs::path below = fs::path(inner).lexically_relative(*fs::path(inner).begin());
    for (const auto& [package, folder] : places.packages)
      if (package == fs::path(inner).begin()->string() && try_path(folder / below)) return found;
  }
  if (const std::string path = without_scheme(name, "file://"); !path.empty()) rest = path;
  if (try_path(rest.is_absolute() ? rest : here / rest)) return found;
  std::vector<fs::path> folders = places.folders;
  std::error_code ignored;
  fs::path up = resolve_path({}, fs::absolute(urdf, ignored)).parent_path();
  for (int i = 0; i < 4 && up.has_relative_path(); ++i, up = up.parent_path())
    folders.push_back(up);
  for (const fs::path& folder : folders)
    for (fs::path end = rest.relative_path(); !end.empty() && end != ".";
         end = end.lexically_relative(*end.begin()))
      if (try_path(folder / end)) return found;
  return std::nullopt;
}

std::size_t RobotFit::shapes() const {
  std::size_t count = 0;
  for (const LinkFit& link : links) count += link.shapes.size();
  return count;
}

double RobotFit::gap_bound_m() const {
  double most = 0.0;
  for (const LinkFit& link : links) most = std::max(most, link.gap.bound_m);
  return most;
}

double RobotFit::excess_max_m() const {
  double most = 0.0;
  for (const LinkFit& link : links) most = std::max(most, link.excess.max_m);
  return most;
}

double RobotFit::excess_mean_m() const {
  double sum = 0.0, area = 0.0;
  for (const LinkFit& link : links) {
    sum += link.excess.mean_m * link.excess.area_m2;
    area += link.excess.area_m2;
  }
  return area > 0.0 ? sum / area : 0.0;
}

double RobotFit::volume_ratio() const {
  double shapes_m3 = 0.0, solids_m3 = 0.0;
  for (const LinkFit& link : links) {
    shapes_m3 += link.excess.volume_m3;
    solids_m3 += link.volume_m3;
  }
  return solids_m3 > 0.0 ? shapes_m3 / solids_m3 : std::numeric_limits<double>::infinity();
}

RobotFit fit_robot(const fs::path& urdf, const FitOptions& options) {
  RobotFit out;
  const std::vector<LinkSolid> solids = GeometryReader(urdf, options, out.notes).read();
  if (options.total) {
    std::size_t least = 0;
    for (const LinkSolid& link : solids) least += link.balls.size() + (link.solid ? 1 : 0);
    if (static_cast<std::size_t>(*options.total) < least)
      throw Error(
          ErrorCode::usage,
          fmt::format("{}: {} shapes requested in total, expected at least {}, one per link",
                      urdf.string(), *options.total, least));
  }
  const auto shapes_at = [&](double excess_m) {
    CoverOptions cover_options = options.cover;
    cover_options.excess_m = excess_m;
    std::vector<std::vector<Shape>> all;
    all.reserve(solids.size());
    for (const LinkSolid& link : solids) all.push_back(shapes_for(link, cover_options));
    return all;
  };
  const auto count = [](const std::vector<std::vector<Shape>>& all) {
    std::size_t sum = 0;
    for (const auto& shapes : all) sum += shapes.size();
    return sum;
  };
  std::vector<std::vector<Shape>> best = shapes_at(options.cover.excess_m);
  if (options.total) {
    const auto total = static_cast<std::size_t>(*options.total);
    // The least excess for which at most `total` shapes are needed, in steps of a factor 13/12.
    constexpr double step = 1.0 + 1.0 / 12.0;
    double excess_m = options.cover.excess_m;
    if (count(best) > total) {
      while (count(best) > total) best = shapes_at(excess_m *= step);
    } else {
      for (int tries = 0; tries < 40; ++tries) {
        auto tighter = shapes_at(excess_m /= step);
        if (count(tighter) > total) break;
        best = std::move(tighter);
      }
    }
  }
  for (std::size_t i = 0; i < solids.size(); ++i) {
    for (Shape& shape : best[i]) shape.radius_m += options.padding_m;
    out.links.push_back(measured(solids[i], std::move(best[i]), options.tolerance_m));
  }
  for (const LinkFit& link : out.links)
    if (link.excess.max_m > options.cover.excess_m + options.padding_m + 1e-3 && !options.total)
      out.notes.push_back(fmt::format(
          "link '{}': {} shapes stick out up to {:.0f} mm, expected at most {:.0f} mm", link.name,
          link.shapes.size(), 1e3 * link.excess.max_m, 1e3 * options.cover.excess_m));
  return out;
}

RobotFit measure_sidecar(const fs::path& urdf, const fs::path& sidecar, const FitOptions& options) {
  RobotFit out;
  const std::vector<LinkSolid> solids = GeometryReader(urdf, options, out.notes).read();
  (void)description::check_spheres(sidecar);
  const Json document = read_json(sidecar);
  std::map<std::string, std::vector<Shape>> shapes;
  for (const auto& [name, list] : document["links"].items())
    for (const Json& ball : list)
      shapes[name].push_back(
          {vector_of(ball["center"]), vector_of(ball["center"]), ball["radius"].get<double>()});
  if (document.contains("capsules"))
    for (const auto& [name, list] : document["capsules"].items())
      for (const Json& capsule : list)
        shapes[name].push_back({vector_of(capsule["from"]), vector_of(capsule["to"]),
                                capsule["radius"].get<double>()});
  for (const LinkSolid& link : solids) {
    if (shapes[link.name].empty())
      out.notes.push_back(fmt::format("link '{}' has geometry but no shapes", link.name));
    out.links.push_back(measured(link, shapes[link.name], options.tolerance_m));
    shapes.erase(link.name);
  }
  for (const auto& [name, list] : shapes)
    if (!list.empty())
      out.notes.push_back(
          fmt::format("link '{}' has {} shapes but no geometry", name, list.size()));
  return out;
}

Json sidecar_json(const RobotFit& fit, const std::string& note,
                  const std::vector<std::pair<std::string, std::string>>& self_collision_disabled) {
  Json out{{"note", note}, {"links", Json::object()}};
  Json capsules = Json::object();
  for (const LinkFit& link : fit.links)
    for (const Shape& shape : link.shapes) {
      if (shape.ball())
        out["links"][link.name].push_back(
            {{"center", numbers(shape.from)}, {"radius", shape.radius_m}});
      else
        capsules[link.name].push_back(
            {{"from", numbers(shape.from)}, {"to", numbers(shape.to)}, {"radius", shape.radius_m}});
    }
  if (!capsules.empty()) out["capsules"] = std::move(capsules);
  if (!self_collision_disabled.empty()) {
    out["self_collision_disabled"] = Json::array();
    for (const auto& [a, b] : self_collision_disabled)
      out["self_collision_disabled"].push_back(Json::array({a, b}));
  }
  return out;
}

Json figures_json(const RobotFit& fit) {
  const auto number = [](double value) {
    return std::isfinite(value) ? Json(value) : Json(nullptr);
  };
  Json links = Json::array();
  for (const LinkFit& link : fit.links) {
    const auto balls = std::count_if(link.shapes.begin(), link.shapes.end(),
                                     [](const Shape& s) { return s.ball(); });
    links.push_back({{"name", link.name},
                     {"triangles", link.triangles},
                     {"closed", link.closed},
                     {"spheres", balls},
                     {"capsules", link.shapes.size() - static_cast<std::size_t>(balls)},
                     {"gap_bound_m", number(link.gap.bound_m)},
                     {"gap_found_m", number(link.gap.found_m)},
                     {"excess_max_m", number(link.excess.max_m)},
                     {"excess_mean_m", number(link.excess.mean_m)},
                     {"volume_ratio", number(link.excess.volume_m3 / link.volume_m3)}});
  }
  return {{"shapes", fit.shapes()},
          {"gap_bound_m", number(fit.gap_bound_m())},
          {"excess_max_m", number(fit.excess_max_m())},
          {"excess_mean_m", number(fit.excess_mean_m())},
          {"volume_ratio", number(fit.volume_ratio())},
          {"links", links},
          {"notes", fit.notes}};
}

std::string sidecar_note(const RobotFit& fit, const std::filesystem::path& urdf, bool capsules) {
  return fmt::format(
      "{} that cover the collision geometry of {} [m, link frames]: coverage gap {:.3g} mm, excess "
      "up to {:.1f} mm",
      capsules ? "Capsules" : "Spheres", urdf.filename().string(), 1e3 * fit.gap_bound_m(),
      1e3 * fit.excess_max_m());
}

}  // namespace hamelin::fit
