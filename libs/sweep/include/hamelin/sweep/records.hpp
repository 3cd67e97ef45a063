#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/sweep/plan.hpp"
#include "hamelin/sweep/shard.hpp"

/// Records of a plan are lines of JSON (hamelin.record/1). A directory has the file
/// `records.jsonl`, and one file `records-I-of-N.jsonl` for each shard that was run in it.
namespace hamelin::sweep {

/// The file to which runs that are not part of a shard are recorded.
[[nodiscard]] std::filesystem::path records_file(const std::filesystem::path& directory);
/// The file of one shard.
[[nodiscard]] std::filesystem::path records_file(const std::filesystem::path& directory,
                                                 const Shard& shard);
/// All files of records that a directory has, sorted by name.
[[nodiscard]] std::vector<std::filesystem::path> record_files(
    const std::filesystem::path& directory);

/// Where the complete lines of a file of records end.
struct RecordsEnd {
  std::size_t complete_bytes = 0;
  bool truncated = false;  ///< whether an incomplete line follows
};

/// A record and its place in a file.
struct PlacedRecord {
  Json record;
  std::size_t run = 0;                  ///< index into Plan::runs
  std::uint64_t offset = 0, bytes = 0;  ///< of its line, without the end of the line
};

/// The index of each run of a plan by its id. Refers to the plan.
class RunIndex {
 public:
  explicit RunIndex(const Plan& plan);
  /// The run of that id; Plan::runs.size() if there is none.
  [[nodiscard]] std::size_t find(std::string_view id) const;
  [[nodiscard]] const Plan& plan() const noexcept { return *plan_; }

 private:
  const Plan* plan_;
  std::vector<std::size_t> by_id_;  ///< sorted by id
};

/// Reads a file of records line by line and passes each one on. A file that does not exist has no
/// records.
/// @throws Error io; parse or invalid, with file and line, for a line that is not a record of this
///         plan, or a run that the file records twice
RecordsEnd read_records(const std::filesystem::path& file, const RunIndex& runs,
                        const std::function<void(PlacedRecord&&)>& visit);

/// Passes on which runs a file of records holds. Of lines that begin as a sweep writes them only
/// the id is read; read_records() checks them.
/// @throws Error as read_records()
void read_recorded_runs(const std::filesystem::path& file, const RunIndex& runs,
                        const std::function<void(std::size_t run)>& visit);

/// The line of a record without what depends on machine, time and place: `timing` and `provenance`
/// of the result are null, and its scene is named as in the plan. Repeated runs of one build give
/// the same text.
[[nodiscard]] std::string repeatable_text(Json record, const PlannedRun& run);

}  // namespace hamelin::sweep
