#include "hamelin/test/readme.hpp"

#include <sstream>

#include "../src/requests.hpp"
#include "serving.hpp"

using namespace hamelin;

TEST_CASE("the README's example reaches the goal", "[serve]") {
  const test::Serving serving;
  const auto socket = serving.socket();
  hamelin_measurement measured{};
  const Eigen::VectorXd start = test::clutter().start_q;
  std::copy(start.begin(), start.end(), measured.q);
  // clang-format off
  // [example]
serve::Client arm(socket);
for (std::uint64_t period = 1; arm.setpoint().state != HAMELIN_CONTROL_REACHED; ++period) {
  measured.sequence = period;
  measured.time_s = arm.link().period_s * static_cast<double>(period);
  arm.send(measured);
  if (!arm.receive(period, 1.0)) break;  // the server has gone
  std::copy_n(arm.setpoint().q, arm.link().joints, measured.q);
  std::copy_n(arm.setpoint().v, arm.link().joints, measured.v);
}
  // [example]
  // clang-format on
  CHECK(arm.setpoint().state == HAMELIN_CONTROL_REACHED);
  test::check_readme_example("libs/serve");
}

TEST_CASE("the README's requests are answered without errors", "[serve]") {
  const auto file = std::filesystem::path(HAMELIN_SOURCE_DIR) / "libs/serve/README.md";
  const std::string page = read_file(file), open = "```json\n";
  const auto begin = page.find(open) + open.size();
  std::istringstream lines(page.substr(begin, page.find("```", begin) - begin));
  control::Controller controller(test::clutter(), test::planners, test::for_positions());
  int count = 0;
  for (std::string request; std::getline(lines, request); ++count) {
    const std::string answer = serve::answer_request(controller, request, test::data / "scenes");
    CAPTURE(request, answer);
    CHECK(answer.find("error") == std::string::npos);
    CHECK(answer.substr(0, answer.find(':')) == request.substr(0, request.find(':')));
  }
  CHECK(count == 10);
}
