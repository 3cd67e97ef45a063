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

/// An integrator to be measured: "gauss:8" is {"gauss", 8}.
struct Scheme {
  std::string integrator;
  int order = 0;  ///< 0: the scheme's default
};

/// Reads "hamel-variational,gauss:8,dop853".
/// @throws Error usage naming --integrators: empty list or entry, an order that is no number, a doubled entry
[[nodiscard]] std::vector<Scheme> read_schemes(const std::string& text);

/// A free motion, and how it is to be integrated.
struct Options {
  std::string name;  ///< of the robot or scene
  Eigen::VectorXd q0, v0;
  integration::Channels channels;  ///< damping and dry friction; empty: none
  double duration_s = 1.0;
  std::vector<Scheme> schemes;
  std::vector<double> steps_s;     ///< fixed steps, each a whole number of times in the duration (to 1e-9 steps)
  std::vector<double> rtols;       ///< step control, for schemes that have it
  std::optional<double> atol;      ///< default: equal to rtol
  std::vector<double> tolerances;  ///< of root-finding, for fixed steps; empty: each scheme's default
  long every = 0;                  ///< energy at every so many fixed steps; 0: so that at most 2^17 are looked at
  bool reference = true;           ///< without, errors in q and v are not known
  double reference_work = 1e8;     ///< each reference scheme's limit: evaluations times joints
  double timing_s = 0.03;          ///< a row is timed over and over for so long, at least twice if shorter than 1 s
  std::function<void(std::size_t done, std::size_t all)> progress;  ///< after each row; may be empty
};

/// What is known of the true motion at the end.
struct Reference {
  Eigen::VectorXd q, v;                 ///< of the finer of two schemes
  double error_q = 0.0, error_v = 0.0;  ///< largest difference between the two [rad or m; per second]
  std::string scheme, check;            ///< the finer, and the other; with their settings
  long evaluations = 0;                 ///< of both, with all their coarser runs
};

/// A slope and the half-width of its interval at 95 %.
struct Slope {
  double value = 0.0, half_width = 0.0;
};

/// Drift of a long series of correlated samples, with constant memory: samples are gathered in 64 to 128 blocks of
/// equal count, two neighbours becoming one when there are 128. The slope is that of the least-squares line through the
/// blocks' means. Neighbouring samples of an energy error are not independent, so its interval is taken from the
/// blocks' scatter about the line, slope ± t √(Σ w r² / (m − 2) / Σ w (t − t̄)²), for m = 64, 32, 16 and 8 blocks, and
/// the widest holds: once a block is longer than the correlation lasts, it grows no more.
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

/// One integration. What does not apply, and what is not known since the run did not end, is none.
struct Row {
  std::string integrator;
  int order = 0;
  bool order_asked = false;          ///< whether the entry named the order
  std::optional<double> step_s;      ///< none under step control
  std::optional<double> rtol, atol;  ///< none for fixed steps
  std::optional<double> tolerance;   ///< of root-finding; none where nothing is solved
  bool completed = true;             ///< else it diverged, and `cause` says where
  std::optional<std::string> cause;
  std::optional<double> error_q, error_v;  ///< largest difference from the reference at the end
  std::optional<double> reference_error, reference_error_v;
  bool reference_limited = false;  ///< error_q is no larger than the reference's: the true one is at most their sum
  std::optional<double> energy_error_max_J, drift_J_per_s, drift_ci_J_per_s;
  long energy_samples = 0;
  std::optional<double> cpu_us;  ///< thread CPU time of start and all steps, least of several runs
  long evaluations = 0, factorizations = 0, steps = 0, rejected = 0, halvings = 0;
  std::string isa, mode;

  /// "gauss:8", and ", controlled" under step control.
  [[nodiscard]] std::string label() const;
  /// The label with tolerance and mode: all but the step.
  [[nodiscard]] std::string settings() const;
  /// What the true error in q cannot exceed if the reference's estimate is right.
  [[nodiscard]] std::optional<double> error_bound() const;
};

/// Everything that one measurement found.
struct Measurement {
  std::string name;
  int dof = 0;
  bool planar = false;
  double duration_s = 0.0;
  std::optional<Reference> reference;
  std::vector<Row> rows;
  std::vector<std::string> notes;
};

/// Integrates the motion by each scheme with each of the steps and tolerances it takes. Energy and errors come from one
/// pass, time from others that do nothing but start and step.
/// @throws Error usage before any work: unknown integrators, orders they have not, steps that do not fit the duration,
/// lists that leave a scheme without a row, sizes that do not match
[[nodiscard]] Measurement measure(const model::Model& model, const Options& options);

/// The finer of two independent schemes, each refined until it stays as it is or costs too much.
[[nodiscard]] Reference find_reference(const model::Model& model, const Options& options);

/// What one scheme with one tolerance needs for an error in q: the cheapest of its rows that stays below.
struct Cheapest {
  std::string settings;                          ///< Row::settings
  std::vector<std::optional<std::size_t>> rows;  ///< one an error, places in Measurement::rows
};

/// The errors that `cheapest` asks for: 1e-2, 1e-3 … 1e-10.
[[nodiscard]] const std::vector<double>& error_targets();
/// By settings, in the order of the rows.
[[nodiscard]] std::vector<Cheapest> cheapest(const Measurement& measurement);

/// hamelin.accuracy/1; only `cpu_us` and `isa` depend on the machine.
[[nodiscard]] Json to_json(const Measurement& measurement);
/// @throws Error invalid naming `where`
[[nodiscard]] Measurement measurement_from_json(const Json& document, const std::string& where);

/// What each scheme needs for an error, where a peer needs less, and the rows: all as plain text, those that hold a
/// place in the table as Markdown.
[[nodiscard]] std::string to_table(const Measurement& measurement);
[[nodiscard]] std::string to_markdown(const Measurement& measurement);

/// What the page of measurements shows, hamelin.accuracy-page/1; the README says what is in it.
[[nodiscard]] Json page_json(const std::vector<Measurement>& all);

}  // namespace hamelin::accuracy
