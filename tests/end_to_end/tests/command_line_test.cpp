// The command line: help, hints at misspelt names, --quiet, --verbose, --json, colour, completion
// and manual pages.
#include <pty.h>

#include <cstdio>
#include <regex>
#include <sstream>

#include "../program.hpp"

using namespace hamelin;
using test::lines_of;
using test::Sandbox;

namespace {

using Strings = std::vector<std::string>;

Strings split_words(const std::string& text) {
  std::istringstream in(text);
  Strings words;
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

Strings concatenated(Strings words, const Strings& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// The output of a bash command line, including its error messages.
test::Output bash(const std::string& command) {
  const std::string script = "exec 2>&1; cd '" + std::string(HAMELIN_SOURCE_DIR) + "'; " + command;
  std::string quoted = "'";
  for (const char c : script) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  std::FILE* pipe = ::popen(("bash --norc --noprofile -c " + quoted + "'").c_str(), "r");
  REQUIRE(pipe != nullptr);
  test::Output output;
  char buffer[4096];
  for (std::size_t n = 0; (n = std::fread(buffer, 1, sizeof buffer, pipe)) > 0;)
    output.out.append(buffer, n);
  const int status = ::pclose(pipe);
  output.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return output;
}

/// All commands that the completion script lists; the empty one is the program itself.
std::vector<Strings> commands(Sandbox& sandbox) {
  const std::string script = sandbox.run({"completion", "bash"}).out;
  std::vector<Strings> all{{}, {"help"}};
  const std::regex path("at=\" ([^\"]+)\"");
  for (std::sregex_iterator found(script.begin(), script.end(), path), end; found != end; ++found)
    all.push_back(split_words((*found)[1]));
  return all;
}

/// The examples of a help text, each as arguments of the program.
std::vector<Strings> examples(const std::string& help) {
  std::vector<Strings> all;
  const auto lines = lines_of(help);
  REQUIRE(lines.at(0) == "Examples:");
  for (std::size_t i = 1; i < lines.size() && !lines[i].empty(); ++i) {
    const auto begin = lines[i].find("hamelin ");
    REQUIRE(begin != std::string::npos);
    auto words = split_words(lines[i].substr(begin, lines[i].find_first_of(">)", begin) - begin));
    words.erase(words.begin());
    all.push_back(words);
  }
  return all;
}

/// The completions that bash offers for the last word, which is being typed.
Strings completions(const Strings& words) {
  std::string line =
      "source <('" HAMELIN_PROGRAM "' completion bash); COMP_WORDS=('" HAMELIN_PROGRAM "'";
  for (const auto& word : words) line += " '" + word + "'";
  line += "); COMP_CWORD=" + std::to_string(words.size()) +
          "; _hamelin; printf '%s\\n' \"${COMPREPLY[@]}\"";
  const auto output = bash(line);
  CAPTURE(output.out);
  REQUIRE(output.exit_code == 0);
  Strings offered = split_words(output.out);
  std::sort(offered.begin(), offered.end());
  return offered;
}

/// The output of the program on a terminal, with these environment variables.
std::string on_terminal(const Strings& arguments,
                        const std::vector<std::pair<const char*, const char*>>& variables,
                        int exit_code = 0) {
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
  REQUIRE(WEXITSTATUS(status) == exit_code);
  return text;
}

bool is_installed(const std::string& program) {
  return bash("command -v " + program).exit_code == 0;
}

bool contains(const Strings& words, const std::string& expected) {
  return std::find(words.begin(), words.end(), expected) != words.end();
}

const Strings free_fall{"integrate", "data/robots/planar3.json", "--duration", "0.1"};

}  // namespace

TEST_CASE("the help of each command begins with valid examples, in lines of at most 100 columns",
          "[command_line]") {
  Sandbox sandbox;
  const auto all = commands(sandbox);
  REQUIRE(all.size() >= 18);
  for (const auto& command : all) {
    CAPTURE(command);
    const auto help = sandbox.run(concatenated(command, {"--help"}));
    CHECK(help.exit_code == 0);
    CHECK(help.err.empty());
    if (!command.empty()) CHECK(sandbox.run(concatenated({"help"}, command)).out == help.out);
    for (const auto& line : lines_of(help.out)) {
      CAPTURE(line);
      CHECK(line.size() <= 100);
    }
    const auto given = examples(help.out);
    CHECK(given.size() >= 2);
    CHECK(given.size() <= 3);
    for (const auto& example : given) {
      CAPTURE(example);
      // --help takes effect after all values are parsed. An unknown option is reported only if it
      // is the first unknown one.
      CHECK(sandbox.run(concatenated(example, {"--help"})).exit_code == 0);
      const auto unknown = sandbox.run(concatenated(example, {"--no-such-option"}));
      CHECK(unknown.exit_code == 2);
      CHECK(unknown.err.find("unknown option '--no-such-option'") != std::string::npos);
    }
  }
}

TEST_CASE("without arguments the program prints its purpose, its commands and how to get help",
          "[command_line]") {
  Sandbox sandbox;
  const auto overview = sandbox.run({});
  CHECK(overview.exit_code == 0);
  CHECK(overview.err.empty());
  const auto lines = lines_of(overview.out);
  CHECK(lines.size() < 40);
  for (const auto& line : lines) CHECK(line.size() <= 100);
  CHECK_THAT(lines.at(0), Catch::StartsWith("hamelin ") && Catch::Contains("robot arms"));
  for (const auto& command : commands(sandbox))
    if (command.size() == 1)
      CHECK(std::any_of(lines.begin(), lines.end(), [&](const std::string& line) {
        return line.starts_with("  " + command[0] + " ");
      }));
  CHECK_THAT(lines.back(),
             Catch::Contains("hamelin COMMAND --help") && Catch::Contains("hamelin help"));
  // Options without a command are an error.
  CHECK(sandbox.run({"-q"}).exit_code == 2);
}

TEST_CASE("a misspelt command, option or value is answered with the nearest name",
          "[command_line]") {
  struct Misspelling {
    Strings arguments;
    std::string expected;
  };
  const std::string scene = "data/scenes/shelf.json", robot = "data/robots/planar3.json";
  const std::vector<Misspelling> cases{
      {{"rnu", scene}, "'run'?"},
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
  Sandbox sandbox;
  for (const auto& misspelt : cases) {
    CAPTURE(misspelt.arguments);
    const auto output = sandbox.run(misspelt.arguments);
    CHECK(output.exit_code == 2);
    CHECK(output.out.empty());
    CHECK(lines_of(output.err).size() == 1);
    CAPTURE(output.err);
    CHECK(output.err.find(misspelt.expected) != std::string::npos);
  }
  CHECK(sandbox.run({"xyzzy"}).err.find("did you mean") == std::string::npos);
}

TEST_CASE("with --json standard output is one JSON document", "[command_line]") {
  const std::string shelf = "data/scenes/shelf.json";
  const std::vector<Strings> all{
      free_fall,
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
  Sandbox sandbox;
  for (const auto& command : all) {
    CAPTURE(command);
    CHECK(!test::run_json(sandbox, command).empty());
    CHECK(!test::run_json(sandbox, concatenated({"-q"}, command)).empty());
  }

  const auto both = sandbox.run({"validate", shelf, "absent.json", "--json"});
  CHECK(both.exit_code == 2);
  CHECK(lines_of(both.err).size() == 1);
  const Json entries = parse_json(both.out, "standard output");
  CHECK(entries[0]["ok"] == true);
  CHECK(entries[1]["ok"] == false);
  CHECK(entries[1]["error"].get<std::string>().find("absent.json") != std::string::npos);
}

TEST_CASE(
    "quiet prints errors and data only, verbose also the files read, before and after the command",
    "[command_line]") {
  Sandbox sandbox;
  const Strings valid{"validate", "data/scenes/shelf.json"}, absent{"validate", "absent.json"};
  for (const std::string flag : {"-q", "--quiet"}) {
    CAPTURE(flag);
    for (const auto& command : {concatenated({flag}, valid), concatenated(valid, {flag})}) {
      const auto output = sandbox.run(command);
      CHECK(output.exit_code == 0);
      CHECK(output.out.empty());
      CHECK(output.err.empty());
    }
    CHECK(lines_of(sandbox.run(concatenated(absent, {flag})).err).size() == 1);
    CHECK(!sandbox.run({"robot", "info", "data/robots/planar3.json", flag}).out.empty());
  }
  const auto plain = sandbox.run(valid);
  CHECK(plain.err.empty());
  for (const auto& command : {concatenated({"-v"}, valid), concatenated(valid, {"--verbose"})}) {
    const auto output = sandbox.run(command);
    CHECK(output.out == plain.out);
    CHECK(output.err.find("reading data/scenes/shelf.json: a scene") != std::string::npos);
  }
  CHECK(sandbox.run({"plugins", "list", "-v"}).err.find("searching for planners in") !=
        std::string::npos);
  CHECK(sandbox.run(concatenated(valid, {"-q", "-v"})).exit_code == 2);
}

TEST_CASE("colour appears only on terminals, and can be disabled", "[command_line]") {
  const int terminal = ::posix_openpt(O_RDWR | O_NOCTTY);
  test::skip_unless(terminal >= 0, "no pseudo-terminal is available");
  ::close(terminal);
  const std::string escape = "\033[";
  CHECK(on_terminal(free_fall, {{"TERM", "xterm"}, {"NO_COLOR", ""}}).find(escape) !=
        std::string::npos);
  CHECK(on_terminal(free_fall, {{"TERM", "xterm"}, {"NO_COLOR", "1"}}).find(escape) ==
        std::string::npos);
  CHECK(on_terminal(free_fall, {{"TERM", "dumb"}, {"NO_COLOR", ""}}).find(escape) ==
        std::string::npos);
  CHECK(on_terminal(concatenated(free_fall, {"--no-color"}), {{"TERM", "xterm"}, {"NO_COLOR", ""}})
            .find(escape) == std::string::npos);
  Sandbox sandbox;
  CHECK(sandbox.run(free_fall).out.find(escape) == std::string::npos);
}

TEST_CASE("export does not print MCAP files on a terminal", "[command_line]") {
  const int terminal = ::posix_openpt(O_RDWR | O_NOCTTY);
  test::skip_unless(terminal >= 0, "no pseudo-terminal is available");
  ::close(terminal);
  CHECK(on_terminal({"export", "run.jsonl", "--format", "mcap"}, {{"TERM", "xterm"}}, 2)
            .find("standard output is a terminal, expected --output FILE") != std::string::npos);
}

TEST_CASE("bash completes commands, options, values, planners and files", "[command_line]") {
  test::skip_unless(is_installed("bash"), "bash is not installed, so completion is not tested");
  CHECK(completions({"sc"}) == Strings{"scene", "schema"});
  CHECK(completions({"scene", ""}) == Strings{"crop", "info", "make"});
  CHECK(completions({"help", "scene", "m"}) == Strings{"make"});
  CHECK(completions({"-q", "plugins", "l"}) == Strings{"list"});
  CHECK(completions({"run", "--pl"}) == Strings{"--planner", "--plant", "--plugin-path"});
  CHECK(completions({"scene", "info", "--qu"}) == Strings{"--quiet"});
  CHECK(completions({"integrate", "x.json", "--integrator", "hamel-"}) ==
        Strings{"hamel-midpoint", "hamel-variational"});
  CHECK(completions({"integrate", "--integrator", "=", "rk"}) == Strings{"rk4"});
  CHECK(completions({"integrate", "--start", "="}) == Strings{"consistent", "published"});
  CHECK(completions({"schema", "print", "sc"}) == Strings{"scene"});
  CHECK(completions({"completion", ""}) == Strings{"bash"});
  CHECK(completions({"run", "data/scenes/cl"}) == Strings{"data/scenes/clutter.json"});
  CHECK(completions({"scene", "info", "data/maps/shelf"}) ==
        Strings{"data/maps/shelf.bt", "data/maps/shelf.primitives.json"});
  CHECK(completions({"run", "--plugin-path", "data/ma"}) == Strings{"data/maps"});
  CHECK(completions({"run", "--step", ""}).empty());
  const auto planners = completions({"run", "x.json", "--planner", ""});
  for (const char* planner : {"apf", "gyro", "hybrid"}) CHECK(contains(planners, planner));
}

TEST_CASE("man formats the manual page of each command without a warning", "[command_line]") {
  Sandbox sandbox;
  REQUIRE(sandbox.run({"man", "pages"}).exit_code == 0);
  const auto all = commands(sandbox);
  for (const auto& command : all) {
    std::string name = "hamelin";
    for (const auto& word : command) name += "-" + word;
    CAPTURE(name);
    REQUIRE(sandbox.has("pages/" + name + ".1"));
    const std::string page = sandbox.text("pages/" + name + ".1");
    for (const char* section : {".SH NAME", ".SH SYNOPSIS", ".SH EXAMPLES", ".SH SEE ALSO"})
      CHECK(page.find(section) != std::string::npos);
  }
  test::skip_unless(is_installed("man") && is_installed("lexgrog"),
                    "man or lexgrog is not installed, so the pages are not tested");
  const auto formatted = bash("pages=$(mktemp -d); '" HAMELIN_PROGRAM
                              "' man \"$pages\"; for page in \"$pages\"/*.1; do"
                              " man --warnings -E UTF-8 -l -Tutf8 -Z \"$page\" > /dev/null; "
                              "lexgrog \"$page\" > /dev/null || echo \"$page\";"
                              " done; rm -r \"$pages\"");
  CHECK(formatted.exit_code == 0);
  CHECK(formatted.out.empty());
}
