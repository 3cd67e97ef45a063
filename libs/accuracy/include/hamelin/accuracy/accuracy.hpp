#pragma once
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/integration/integrator.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/model/model.hpp"

/// Speed against error of integrators in free motion; behind `hamelin accuracy`.
namespace hamelin::accuracy {

/// An integrator to measure: "gauss:8" is {"gauss", 8}.
struct Scheme {
  std::string integrator;
  int order = 0;  ///< 0: the scheme's default
};

/// Reads "hamel-variational,gauss:8,dop853".
/// @throws Error usage naming --integrators: empty list or entry, an order that is not a number, a
/// duplicate entry
[[nodiscard]] std::vector<Scheme> read_schemes(const std::string& text);

/// A free motion, and how to integrate it.
struct Options {
  std::string name;  ///< of the robot or scene
  Eigen::VectorXd q0, v0;
  integration::Channels channels;  ///< damping and dry friction; empty: none
  double duration_s = 1.0;
  std::vector<Scheme> schemes;
  /// Fixed steps. The duration is an integer multiple of each (to 1e-9 steps).
  std::vector<double> steps_s;
  std::vector<double> rtols;       ///< of step control, for schemes that have it
  std::optional<double> atol;      ///< default: equal to rtol
  std::vector<double> tolerances;  ///< of root-finding, for fixed steps; empty: the default
  long every = 0;                  ///< steps between energy samples; 0: for about 2^17 samples
  bool reference = true;           ///< false: errors in q and v are unknown
  double reference_work = 1e8;     ///< limit of each reference scheme: evaluations times joints
  double timing_s = 0.03;          ///< total time of the timing passes; twice at least if below 1 s
  std::function<void(std::size_t done, std::size_t all)> progress;  ///< called after each row
  std::function<void()> poll;  ///< called every 1000 steps; may throw to end the measurement
};

/// The end of the reference motion, docs/theory.md (13.4).
struct Reference {
  Eigen::VectorXd q, v;                 ///< of the finer of two schemes
  double error_q = 0.0, error_v = 0.0;  ///< largest difference of the two [rad or m; per second]
  std::string scheme, check;            ///< the finer and the other one, with their settings
  long evaluations = 0;                 ///< of both, including their coarser runs
};

/// A slope and the half-width of its interval at 95 %.
struct Slope {
  double value = 0.0, half_width = 0.0;
};

/// Drift of a long series of autocorrelated samples, with constant memory: the slope of a
/// least-squares line through block means, and its interval by batch means, docs/theory.md
/// (13.9)–(13.11).
class Drift {
 public:
  void add(double time_s, double value);
  /// None below 16 samples.
  [[nodiscard]] std::optional<Slope> slope() const;
  [[nodiscard]] long samples() const noexcept { return samples_; }

 private:
  struct Block {
    double count = 0.0, time_s = 0.0, value = 0.0;  ///< samples, and their means
  };
  static void join(Block& into, const Block& other);

  std::vector<Block> blocks_;
  long per_block_ = 1, samples_ = 0;
};

/// One integration. Fields that do not apply, or are unknown because the run did not end, are
/// empty.
struct Row {
  std::string integrator;
  int order = 0;
  bool order_asked = false;          ///< whether the order was specified
  std::optional<double> step_s;      ///< empty under step control
  std::optional<double> rtol, atol;  ///< empty for fixed steps
  std::optional<double> tolerance;   ///< of root-finding; empty for explicit schemes
  bool completed = true;             ///< if not, it diverged, and `cause` says where
  std::optional<std::string> cause;
  std::optional<double> error_q, error_v;  ///< at the end, docs/theory.md (13.1)
  std::optional<double> reference_error, reference_error_v;
  bool reference_limited = false;  ///< error_q is at most the reference's own error
  std::optional<double> energy_error_max_J, drift_J_per_s, drift_ci_J_per_s;
  long energy_samples = 0;
  std::optional<double> cpu_us;  ///< thread CPU time of start and all steps, least of several runs
  long evaluations = 0, factorizations = 0, steps = 0, rejected = 0, halvings = 0;
  std::string isa, mode;

  /// "gauss:8", and ", controlled" under step control.
  [[nodiscard]] std::string label() const;
  /// The label with tolerance and mode: everything except the step.
  [[nodiscard]] std::string settings() const;
  /// A bound of the true error in q if the reference's own error is correct, docs/theory.md (13.5).
  [[nodiscard]] std::optional<double> error_bound() const;
};

/// All results of one measurement.
struct Measurement {
  std::string name;
  int dof = 0;
  bool planar = false;
  double duration_s = 0.0;
  std::optional<Reference> reference;
  std::vector<Row> rows;
  std::vector<std::string> notes;
};

/// Integrates the motion by each scheme with each of its steps and tolerances. Energy and errors
/// are measured in one pass, time in other passes that only start and step.
/// @throws Error usage before any work: unknown integrators or orders, steps that do not divide the
/// duration, lists that leave a scheme without a row, sizes that do not match
[[nodiscard]] Measurement measure(const model::Model& model, const Options& options);

/// The finer of two independent schemes, each refined until it no longer changes or costs too much,
/// docs/theory.md (13.2)–(13.4).
[[nodiscard]] Reference find_reference(const model::Model& model, const Options& options);

/// For each error in q the cheapest row of one scheme with one tolerance, docs/theory.md (13.6).
struct Cheapest {
  std::string settings;                          ///< Row::settings
  std::vector<std::optional<std::size_t>> rows;  ///< one index of Measurement::rows per error
};

/// The errors that `cheapest` uses: 1e-2, 1e-3, …, 1e-10.
[[nodiscard]] const std::vector<double>& error_targets();
/// One entry per settings, in the order of the rows.
[[nodiscard]] std::vector<Cheapest> cheapest(const Measurement& measurement);

/// hamelin.accuracy/1; only `cpu_us` and `isa` depend on the machine.
[[nodiscard]] Json to_json(const Measurement& measurement);
/// @throws Error invalid naming `where`
[[nodiscard]] Measurement measurement_from_json(const Json& document, const std::string& where);

/// The time that each scheme needs for an error, where a peer needs less, and the rows: all rows as
/// plain text, or in Markdown those that are the cheapest for some error.
[[nodiscard]] std::string to_table(const Measurement& measurement);
[[nodiscard]] std::string to_markdown(const Measurement& measurement);

/// The data of the page of measurements, hamelin.accuracy-page/1, described in the README.
[[nodiscard]] Json page_json(const std::vector<Measurement>& all);

}  // namespace hamelin::accuracy
