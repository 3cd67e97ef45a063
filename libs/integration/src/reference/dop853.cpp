#include "dop853.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "finite.hpp"
#include "hamelin/core/formatted.hpp"
#include "step_controller.hpp"

namespace hamelin::integration {

namespace {

// The published tableau. Row s − 1 holds the weights of stage s. The nodes (the sums of the rows)
// are not needed, because nothing depends on time.
using Row = std::array<double, 12>;
constexpr std::array<Row, 11> A{
    Row{{5.26001519587677318785587544488e-2}},
    Row{{1.97250569845378994544595329183e-2, 5.91751709536136983633785987549e-2}},
    Row{{2.95875854768068491816892993775e-2, 0, 8.87627564304205475450678981324e-2}},
    Row{{2.41365134159266685502369798665e-1, 0, -8.84549479328286085344864962717e-1,
         9.24834003261792003115737966543e-1}},
    Row{{3.7037037037037037037037037037e-2, 0, 0, 1.70828608729473871279604482173e-1,
         1.25467687566822425016691814123e-1}},
    Row{{3.7109375e-2, 0, 0, 1.70252211019544039314978060272e-1, 6.02165389804559606850219397283e-2,
         -1.7578125e-2}},
    Row{{3.70920001185047927108779319836e-2, 0, 0, 1.70383925712239993810214054705e-1,
         1.07262030446373284651809199168e-1, -1.53194377486244017527936158236e-2,
         8.27378916381402288758473766002e-3}},
    Row{{6.24110958716075717114429577812e-1, 0, 0, -3.36089262944694129406857109825,
         -8.68219346841726006818189891453e-1, 2.75920996994467083049415600797e1,
         2.01540675504778934086186788979e1, -4.34898841810699588477366255144e1}},
    Row{{4.77662536438264365890433908527e-1, 0, 0, -2.48811461997166764192642586468,
         -5.90290826836842996371446475743e-1, 2.12300514481811942347288949897e1,
         1.52792336328824235832596922938e1, -3.32882109689848629194453265587e1,
         -2.03312017085086261358222928593e-2}},
    Row{{-9.3714243008598732571704021658e-1, 0, 0, 5.18637242884406370830023853209,
         1.09143734899672957818500254654, -8.14978701074692612513997267357,
         -1.85200656599969598641566180701e1, 2.27394870993505042818970056734e1,
         2.49360555267965238987089396762, -3.0467644718982195003823669022}},
    Row{{2.27331014751653820792359768449, 0, 0, -1.05344954667372501984066689879e1,
         -2.00087205822486249909675718444, -1.79589318631187989172765950534e1,
         2.79488845294199600508499808837e1, -2.85899827713502369474065508674,
         -8.87285693353062954433549289258, 1.23605671757943030647266201528e1,
         6.43392746015763530355970484046e-1}}};
constexpr Row b{5.42937341165687622380535766363e-2,
                0,
                0,
                0,
                0,
                4.45031289275240888144113950566,
                1.89151789931450038304281599044,
                -5.8012039600105847814672114227,
                3.1116436695781989440891606237e-1,
                -1.52160949662516078556178806805e-1,
                2.01365400804030348374776537501e-1,
                4.47106157277725905176885569043e-2};
// Differences to the embedded formulas of orders 5 and 3; the latter uses stages 1, 9 and 12 only.
constexpr Row error5{0.1312004499419488073250102996e-1,
                     0,
                     0,
                     0,
                     0,
                     -0.1225156446376204440720569753e+1,
                     -0.4957589496572501915214079952,
                     0.1664377182454986536961530415e+1,
                     -0.3503288487499736816886487290,
                     0.3341791187130174790297318841,
                     0.8192320648511571246570742613e-1,
                     -0.2235530786388629525884427845e-1};
constexpr Row error3 = [] {
  Row e = b;
  e[0] -= 0.244094488188976377952755905512;
  e[8] -= 0.733846688281611857341361741547;
  e[11] -= 0.220588235294117647058823529412e-1;
  return e;
}();

// Selects weights by number for templates; 1 to 11 are the rows of the stages.
constexpr std::size_t solution = 0, fifth = 12, third = 13;
constexpr Row weights(std::size_t which) {
  return which == solution ? b : which == fifth ? error5 : which == third ? error3 : A[which - 1];
}

// The default settings of the published controller, without memory: docs/theory.md (7.16).
constexpr StepController::Rule rule{8.0, 0.9, 0.333, 6.0};

// out = base + h Σ_j w[j] k[j] over the weights that are not zero, in one pass without temporaries.
template <std::size_t which>
void combine(const VectorXd& base, double h, const std::array<VectorXd, 12>& k,
             VectorXd& out) noexcept {
  constexpr Row w = weights(which);
  const auto used = [&]<std::size_t... j>(std::index_sequence<j...>) {
    const double* const from[] = {k[j].data()...};
    for (Eigen::Index i = 0; i < base.size(); ++i) {
      double sum = 0.0;
      ((w[j] != 0.0 ? void(sum += w[j] * from[j][i]) : void()), ...);
      out[i] = base[i] + h * sum;
    }
  };
  used(std::make_index_sequence<12>{});
}

// Σ_j w[j] k[j][i].
template <std::size_t which>
double component(const std::array<VectorXd, 12>& k, Eigen::Index i) noexcept {
  constexpr Row w = weights(which);
  return [&]<std::size_t... j>(std::index_sequence<j...>) {
    double sum = 0.0;
    ((w[j] != 0.0 ? void(sum += w[j] * k[j][i]) : void()), ...);
    return sum;
  }
  (std::make_index_sequence<12>{});
}

}  // namespace

Dop853::Dop853(const Model& model, const Dop853Options& options)
    : Explicit("dop853", model, {.isa = options.isa, .rtol = options.rtol, .atol = options.atol}) {
  for (auto* x : {&q_, &q_new_, &v_new_}) *x = VectorXd::Zero(model.dof());
  v_.fill(q_);
  a_.fill(q_);
}

std::string Dop853::criterion() const {
  return adaptive() ? formatted("error <= {} + {} |(q, v)|, rms", settings_.atol, settings_.rtol)
                    : "explicit";
}

void Dop853::first_stage(const State& state, const Channels& channels, StepReport& report) {
  v_[0] = state.v;
  accelerate(channels, state.q, state.v, report);
  a_[0] = acceleration_;
  first_ = {};
  forces_.add_work(first_, state.v, 1.0);
}

template <std::size_t s>
void Dop853::stage(const State& state, const Channels& channels, double h, StepReport& report) {
  combine<s>(state.q, h, v_, q_);
  combine<s>(state.v, h, a_, v_[s]);
  accelerate(channels, q_, v_[s], report);
  a_[s] = acceleration_;
  forces_.add_work(report, v_[s], b[s] * h);
}

void Dop853::stages(const State& state, const Channels& channels, double h, StepReport& report) {
  report.gyroscopic_work_J = b[0] * h * first_.gyroscopic_work_J;
  report.dissipated_J = b[0] * h * first_.dissipated_J;
  report.held_work_J = b[0] * h * first_.held_work_J;
  report.external_work_J = b[0] * h * first_.external_work_J;
  [&]<std::size_t... s>(std::index_sequence<s...>) {
    (stage<s + 1>(state, channels, h, report), ...);
  }
  (std::make_index_sequence<count - 1>{});
  combine<solution>(state.q, h, v_, q_new_);
  combine<solution>(state.v, h, a_, v_new_);
}

StepReport Dop853::attempt(State& state, const Channels& channels, double h) {
  StepReport report;
  first_stage(state, channels, report);
  stages(state, channels, h, report);
  report.converged = all_finite(q_new_) && all_finite(v_new_);
  if (!report.converged) return report;
  state.q = q_new_;
  state.v = v_new_;
  return report;
}

double Dop853::error_norm(const State& state, double h) const {
  double sum5 = 0.0, sum3 = 0.0;
  const auto add = [&](const VectorXd& before, const VectorXd& after,
                       const std::array<VectorXd, count>& k) {
    for (Eigen::Index i = 0; i < before.size(); ++i) {
      const double scale = 1.0 / (settings_.atol + settings_.rtol * std::max(std::abs(before[i]),
                                                                             std::abs(after[i])));
      const double e5 = component<fifth>(k, i) * scale, e3 = component<third>(k, i) * scale;
      sum5 += e5 * e5;
      sum3 += e3 * e3;
    }
  };
  add(state.q, q_new_, v_);
  add(state.v, v_new_, a_);
  const double joined = sum5 + 0.01 * sum3;
  return joined == 0.0 ? 0.0
                       : h * sum5 / std::sqrt(joined * static_cast<double>(2 * state.q.size()));
}

StepReport Dop853::controlled_step(State& state, const Channels& channels, double limit) {
  StepReport report;
  report.converged = false;
  first_stage(state, channels, report);
  StepController control(rule, state, limit);
  while (control.has_try()) {
    stages(state, channels, control.step(), report);
    report.residual =
        all_finite(q_new_) && all_finite(v_new_) ? error_norm(state, control.step()) : std::nan("");
    if (!control.accepts(report.residual)) continue;
    state.q = q_new_;
    state.v = v_new_;
    control.finish(state, report);
  }
  report.rejected = control.rejected();
  return report;
}

}  // namespace hamelin::integration
