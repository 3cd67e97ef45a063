// How the program talks: help, hints, quiet and verbose, JSON, colour, completion, manual pages.
#include <pty.h>

#include <cstdio>
#include <regex>
#include <sstream>

#include "../program.hpp"

using namespace hamelin;
using test::Bench;
using test::lines_of;

namespace {

using Words = std::vector<std::string>;

Words words_of(const std::string& text) {
  std::istringstream in(text);
  Words words;
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

Words plus(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// What a command line of bash prints, its messages included.
test::Output bash(const std::string& command) {
  const std::string script = "exec 2>&1; cd '" + std::string(HAMELIN_SOURCE_DIR) + "'; " + command;
  std::string quoted = "'";
  for (const char c : script) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  std::FILE* pipe = ::popen(("bash --norc --noprofile -c " + quoted + "'").c_str(), "r");
  REQUIRE(pipe != nullptr);
  test::Output output;
  char buffer[4096];
  for (std::size_t n = 0; (n = std::fread(buffer, 1, sizeof buffer, pipe)) > 0;) output.out.append(buffer, n);
  const int status = ::pclose(pipe);
  output.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return output;
}

/// All commands, as completion knows them; the program itself is the empty one.
std::vector<Words> commands(Bench& bench) {
  const std::string script = bench.run({"completion", "bash"}).out;
  std::vector<Words> all{{}, {"help"}};
  const std::regex path("at=\" ([^\"]+)\"");
  for (std::sregex_iterator found(script.begin(), script.end(), path), end; found != end; ++found)
    all.push_back(words_of((*found)[1]));
  return all;
}

/// The examples of a help text, as arguments of the program.
std::vector<Words> examples(const std::string& help) {
  std::vector<Words> all;
  const auto lines = lines_of(help);
  REQUIRE(lines.at(0) == "Examples:");
  for (std::size_t i = 1; i < lines.size() && !lines[i].empty(); ++i) {
    const auto begin = lines[i].find("hamelin ");
    REQUIRE(begin != std::string::npos);
    auto words = words_of(lines[i].substr(begin, lines[i].find_first_of(">)", begin) - begin));
    words.erase(words.begin());
    all.push_back(words);
  }
  return all;
}

/// Lines that bash would offer after these words; the last one is being typed.
Words completions(const Words& words) {
  std::string line = "source <('" HAMELIN_PROGRAM "' completion bash); COMP_WORDS=('" HAMELIN_PROGRAM "'";
  for (const auto& word : words) line += " '" + word + "'";
  line += "); COMP_CWORD=" + std::to_string(words.size()) + "; _hamelin; printf '%s\\n' \"${COMPREPLY[@]}\"";
  const auto output = bash(line);
  CAPTURE(output.out);
  REQUIRE(output.exit_code == 0);
  Words offered = words_of(output.out);
  std::sort(offered.begin(), offered.end());
  return offered;
}

/// What the program prints on a terminal, with these variables set.
std::string on_terminal(const Words& arguments, const std::vector<std::pair<const char*, const char*>>& variables) {
  int terminal = -1;
  const pid_t child = ::forkpty(&terminal, nullptr, nullptr, nullptr);
  if (child == 0) {
    for (const auto& [name, value] : variables) ::setenv(name, value, 1);
    std::vector<char*> argv{const_cast<char*>(HAMELIN_PROGRAM)};
    for (const auto& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
    argv.push_back(nullptr);
    if (::chdir(HAMELIN_SOURCE_DIR) == 0) ::execv(HAMELIN_PROGRAM, argv.data());
    ::_exit(127);
  }
  REQUIRE(child > 0);
  std::string text;
  char buffer[4096];
  for (ssize_t n = 0; (n = ::read(terminal, buffer, sizeof buffer)) > 0;)
    text.append(buffer, static_cast<std::size_t>(n));
  int status = 0;
  ::waitpid(child, &status, 0);
  ::close(terminal);
  REQUIRE(WIFEXITED(status));
  REQUIRE(WEXITSTATUS(status) == 0);
  return text;
}

bool there_is(const std::string& program) {
  return bash("command -v " + program).exit_code == 0;
}

bool holds(const Words& words, const std::string& wanted) {
  return std::find(words.begin(), words.end(), wanted) != words.end();
}

const Words free_fall{"integrate", "data/robots/planar3.json", "--duration", "0.1"};

}  // namespace

TEST_CASE("each command's help opens with examples that are right, in lines of at most 100 columns", "[manners]") {
  Bench bench;
  const auto all = commands(bench);
  REQUIRE(all.size() >= 18);
  for (const auto& command : all) {
    CAPTURE(command);
    const auto help = bench.run(plus(command, {"--help"}));
    CHECK(help.exit_code == 0);
    CHECK(help.err.empty());
    if (!command.empty()) CHECK(bench.run(plus({"help"}, command)).out == help.out);
    for (const auto& line : lines_of(help.out)) {
      CAPTURE(line);
      CHECK(line.size() <= 100);
    }
    const auto given = examples(help.out);
    CHECK(given.size() >= 2);
    CHECK(given.size() <= 3);
    for (const auto& example : given) {
      CAPTURE(example);
      // --help is answered once all values are read; an unknown option is named if it is the first that is unknown
      CHECK(bench.run(plus(example, {"--help"})).exit_code == 0);
      const auto unknown = bench.run(plus(example, {"--no-such-option"}));
      CHECK(unknown.exit_code == 2);
      CHECK(unknown.err.find("unknown option '--no-such-option'") != std::string::npos);
    }
  }
}

TEST_CASE("without arguments the program prints what it is, its commands and where to go on", "[manners]") {
  Bench bench;
  const auto overview = bench.run({});
  CHECK(overview.exit_code == 0);
  CHECK(overview.err.empty());
  const auto lines = lines_of(overview.out);
  CHECK(lines.size() < 40);
  for (const auto& line : lines) CHECK(line.size() <= 100);
  CHECK_THAT(lines.at(0), Catch::StartsWith("hamelin ") && Catch::Contains("robot arms"));
  for (const auto& command : commands(bench))
    if (command.size() == 1)
      CHECK(std::any_of(lines.begin(), lines.end(),
                        [&](const std::string& line) { return line.starts_with("  " + command[0] + " "); }));
  CHECK_THAT(lines.back(), Catch::Contains("hamelin COMMAND --help") && Catch::Contains("hamelin help"));
  // options alone are no bare call
  CHECK(bench.run({"-q"}).exit_code == 2);
}

TEST_CASE("a slip in a command, an option or a value is answered with the nearest name", "[manners]") {
  struct Slip {
    Words arguments;
    std::string wanted;
  };
  const std::string scene = "data/scenes/shelf.json", robot = "data/robots/planar3.json";
  const std::vector<Slip> slips{{{"rnu", scene}, "'run'?"},
                                {{"help", "rnu"}, "'run'?"},
                                {{"scene", "inof", scene}, "'info'?"},
                                {{"run", scene, "--plannre", "apf"}, "'--planner'?"},
                                {{"run", scene, "--quite"}, "'--quiet'?"},
                                {{"run", scene, "--planner", "gyor"}, "'gyro'?"},
                                {{"run", scene, "--integrator", "rk5"}, "'rk4'?"},
                                {{"integrate", robot, "--integrator", "RK4"}, "'rk4'?"},
                                {{"integrate", robot, "--start", "publishd"}, "'published'?"},
                                {{"schema", "print", "scnee"}, "'scene'?"},
                                {{"--planner", "apf", "run", scene}, "belongs after the command"}};
  Bench bench;
  for (const auto& slip : slips) {
    CAPTURE(slip.arguments);
    const auto output = bench.run(slip.arguments);
    CHECK(output.exit_code == 2);
    CHECK(output.out.empty());
    CHECK(lines_of(output.err).size() == 1);
    CAPTURE(output.err);
    CHECK(output.err.find(slip.wanted) != std::string::npos);
  }
  CHECK(bench.run({"xyzzy"}).err.find("did you mean") == std::string::npos);
}

TEST_CASE("with --json standard output is one JSON document", "[manners]") {
  const std::string shelf = "data/scenes/shelf.json";
  const std::vector<Words> all{free_fall,
                               {"accuracy", "data/robots/planar3.json", "--integrators", "rk4", "--steps", "0.1"},
                               {"robot", "info", "data/robots/arm7.urdf"},
                               {"robot", "make-chain", "--links", "2", "-o", "chain.json"},
                               {"scene", "info", shelf},
                               {"scene", "info", "data/maps/shelf.bt"},
                               {"scene", "make", "--clutter", "2", "-o", "clutter.bt"},
                               {"plugins", "list"},
                               {"plugins", "check", "gyro"},
                               {"validate", shelf, "data/maps/shelf.bt"},
                               {"schema", "print"},
                               {"schema", "print", "scene"},
                               {"sweep", "pairs", shelf, "--count", "1", "--duration", "0.1"}};
  Bench bench;
  for (const auto& command : all) {
    CAPTURE(command);
    CHECK(!test::run_json(bench, command).empty());
    CHECK(!test::run_json(bench, plus({"-q"}, command)).empty());
  }

  const auto mixed = bench.run({"validate", shelf, "absent.json", "--json"});
  CHECK(mixed.exit_code == 2);
  CHECK(lines_of(mixed.err).size() == 1);
  const Json entries = parse_json(mixed.out, "standard output");
  CHECK(entries[0]["ok"] == true);
  CHECK(entries[1]["ok"] == false);
  CHECK(entries[1]["error"].get<std::string>().find("absent.json") != std::string::npos);
}

TEST_CASE("quiet leaves errors and data, verbose adds what is read, before and after the command", "[manners]") {
  Bench bench;
  const Words valid{"validate", "data/scenes/shelf.json"}, absent{"validate", "absent.json"};
  for (const std::string flag : {"-q", "--quiet"}) {
    CAPTURE(flag);
    for (const auto& command : {plus({flag}, valid), plus(valid, {flag})}) {
      const auto output = bench.run(command);
      CHECK(output.exit_code == 0);
      CHECK(output.out.empty());
      CHECK(output.err.empty());
    }
    CHECK(lines_of(bench.run(plus(absent, {flag})).err).size() == 1);
    CHECK(!bench.run({"robot", "info", "data/robots/planar3.json", flag}).out.empty());
  }
  const auto plain = bench.run(valid);
  CHECK(plain.err.empty());
  for (const auto& command : {plus({"-v"}, valid), plus(valid, {"--verbose"})}) {
    const auto output = bench.run(command);
    CHECK(output.out == plain.out);
    CHECK(output.err.find("reading data/scenes/shelf.json: a scene") != std::string::npos);
  }
  CHECK(bench.run({"plugins", "list", "-v"}).err.find("looked for in") != std::string::npos);
  CHECK(bench.run(plus(valid, {"-q", "-v"})).exit_code == 2);
}

TEST_CASE("colour is for terminals that want it", "[manners]") {
  if (const int terminal = ::posix_openpt(O_RDWR | O_NOCTTY); terminal >= 0) {
    ::close(terminal);
  } else {
    WARN("no pseudo-terminal to be had here: skipped");
    return;
  }
  const std::string escape = "\033[";
  CHECK(on_terminal(free_fall, {{"TERM", "xterm"}, {"NO_COLOR", ""}}).find(escape) != std::string::npos);
  CHECK(on_terminal(free_fall, {{"TERM", "xterm"}, {"NO_COLOR", "1"}}).find(escape) == std::string::npos);
  CHECK(on_terminal(free_fall, {{"TERM", "dumb"}, {"NO_COLOR", ""}}).find(escape) == std::string::npos);
  CHECK(on_terminal(plus(free_fall, {"--no-color"}), {{"TERM", "xterm"}, {"NO_COLOR", ""}}).find(escape) ==
        std::string::npos);
  Bench bench;
  CHECK(bench.run(free_fall).out.find(escape) == std::string::npos);
}

TEST_CASE("bash completes commands, options, values, planners and files", "[manners]") {
  if (!there_is("bash")) {
    WARN("no bash here: completion is not tried");
    return;
  }
  CHECK(completions({"sc"}) == Words{"scene", "schema"});
  CHECK(completions({"scene", ""}) == Words{"crop", "info", "make"});
  CHECK(completions({"help", "scene", "m"}) == Words{"make"});
  CHECK(completions({"-q", "plugins", "l"}) == Words{"list"});
  CHECK(completions({"run", "--pl"}) == Words{"--planner", "--plugin-path"});
  CHECK(completions({"scene", "info", "--qu"}) == Words{"--quiet"});
  CHECK(completions({"integrate", "x.json", "--integrator", "hamel-"}) == Words{"hamel-midpoint", "hamel-variational"});
  CHECK(completions({"integrate", "--integrator", "=", "rk"}) == Words{"rk4"});
  CHECK(completions({"integrate", "--start", "="}) == Words{"consistent", "published"});
  CHECK(completions({"schema", "print", "sc"}) == Words{"scene"});
  CHECK(completions({"completion", ""}) == Words{"bash"});
  CHECK(completions({"run", "data/scenes/sh"}) == Words{"data/scenes/shelf.json"});
  CHECK(completions({"scene", "info", "data/maps/shelf"}) ==
        Words{"data/maps/shelf.bt", "data/maps/shelf.primitives.json"});
  CHECK(completions({"run", "--plugin-path", "data/ma"}) == Words{"data/maps"});
  CHECK(completions({"run", "--step", ""}).empty());
  const auto planners = completions({"run", "x.json", "--planner", ""});
  for (const char* planner : {"apf", "gyro", "hybrid"}) CHECK(holds(planners, planner));
}

TEST_CASE("each command has a manual page that man takes without a warning", "[manners]") {
  Bench bench;
  REQUIRE(bench.run({"man", "pages"}).exit_code == 0);
  const auto all = commands(bench);
  for (const auto& command : all) {
    std::string name = "hamelin";
    for (const auto& word : command) name += "-" + word;
    CAPTURE(name);
    REQUIRE(bench.has("pages/" + name + ".1"));
    const std::string page = bench.text("pages/" + name + ".1");
    for (const char* section : {".SH NAME", ".SH SYNOPSIS", ".SH EXAMPLES", ".SH SEE ALSO"})
      CHECK(page.find(section) != std::string::npos);
  }
  if (!there_is("man") || !there_is("lexgrog")) {
    WARN("no man or lexgrog here: the pages are not tried");
    return;
  }
  const auto tried = bash(
      "pages=$(mktemp -d); '" HAMELIN_PROGRAM
      "' man \"$pages\"; for page in \"$pages\"/*.1; do"
      " man --warnings -E UTF-8 -l -Tutf8 -Z \"$page\" > /dev/null; lexgrog \"$page\" > /dev/null || echo \"$page\";"
      " done; rm -r \"$pages\"");
  CHECK(tried.exit_code == 0);
  CHECK(tried.out.empty());
}
