#include "hamelin/sweep/emit.hpp"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <string>

#include "hamelin/core/error.hpp"
#include "scripted_sweep.hpp"

using namespace hamelin;
using namespace hamelin::sweep;

namespace {

/// Whether bash finds no syntax error.
bool parses(const ScriptedSweep& sweep, const std::string& script) {
  sweep.put("script.sh", script);
  return std::system(("bash -n '" + (sweep.root() / "script.sh").string() + "'").c_str()) == 0;
}

}  // namespace

TEST_CASE("the script for Slurm is a job array with one task per shard", "[sweep][unit]") {
  const ScriptedSweep sweep(3);
  ScriptOptions options{sweep.root(), 40, 2, "/opt/my programs/hamelin", {"/opt/planners"}};
  const std::string plain = slurm_script(options, {});
  CHECK(parses(sweep, plain));
  CHECK_THAT(plain, Catch::Contains("#SBATCH --array=1-40\n") &&
                        Catch::Contains("#SBATCH --cpus-per-task=2\n") &&
                        Catch::Contains("'/opt/my programs/hamelin' --quiet sweep run ") &&
                        Catch::Contains("/40 --jobs 2 --plugin-path /opt/planners &\n") &&
                        !Catch::Contains("--time"));
  const std::string limited = slurm_script(options, "02:00:00");
  CHECK(parses(sweep, limited));
  CHECK_THAT(limited,
             Catch::Contains("#SBATCH --time=02:00:00\n") && Catch::Contains("scontrol requeue"));
  for (const char* time : {"", "2 hours", "1:00\n#SBATCH --exclusive"})
    CHECK_THROWS_WITH(slurm_script(options, time), Catch::Contains("is not a time limit of Slurm"));
}

TEST_CASE("the script for GNU parallel names hosts and what is sent to them", "[sweep][unit]") {
  const ScriptedSweep sweep(3);
  const ScriptOptions options{sweep.root(), 12, 1, "hamelin", {}};
  const std::string local = parallel_script(options, {});
  CHECK(parses(sweep, local));
  CHECK_THAT(local, Catch::Contains("seq 12 | parallel") && !Catch::Contains("--sshlogin"));
  const std::string shared = parallel_script(options, Hosts{"node1,2/node 2", {}});
  CHECK(parses(sweep, shared));
  CHECK_THAT(shared, Catch::Contains("--sshlogin 'node1,2/node 2'") && !Catch::Contains("unpack"));
  const std::string sent = parallel_script(options, Hosts{"node1", "it's/tries"});
  CHECK(parses(sweep, sent));
  CHECK_THAT(sent, Catch::Contains("--basefile sweep.tar.zst") && Catch::Contains("sweep unpack") &&
                       Catch::Contains("--return records-{}-of-12.jsonl"));
}
