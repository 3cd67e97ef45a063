#include "hamelin/io/file.hpp"

#include <unistd.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>

#include "hamelin/core/error.hpp"
#include "hamelin/test/skip.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;
namespace fs = std::filesystem;

namespace {

struct Folder {
  [[nodiscard]] std::ptrdiff_t files() const {
    return std::distance(fs::directory_iterator(path), fs::directory_iterator());
  }
  test::TemporaryFolder folder;
  const fs::path& path = folder.path();
};

// Root may write everywhere. Until its destruction, this makes root a user who may not, and gives
// that user the folder.
class UnprivilegedUser {
 public:
  explicit UnprivilegedUser(const fs::path& folder) {
    if (::geteuid() != 0) return;
    constexpr uid_t nobody = 65534;
    was_root_ =
        ::chown(folder.c_str(), nobody, static_cast<gid_t>(-1)) == 0 && ::seteuid(nobody) == 0;
    test::skip_unless(was_root_, "root cannot become another user here");
  }
  UnprivilegedUser(const UnprivilegedUser&) = delete;
  UnprivilegedUser& operator=(const UnprivilegedUser&) = delete;
  ~UnprivilegedUser() {
    if (was_root_) (void)!::seteuid(0);
  }

 private:
  bool was_root_ = false;
};

}  // namespace

TEST_CASE("bytes come back as they were written, and nothing else is left in the folder",
          "[io][unit]") {
  const Folder folder;
  const std::string bytes("a\0b\r\n\xff", 6);
  write_file_atomically(folder.path / "f", bytes);
  CHECK(read_file(folder.path / "f") == bytes);
  write_file_atomically(folder.path / "f", "shorter");
  CHECK(read_file(folder.path / "f") == "shorter");
  write_file_atomically(folder.path / "empty", "");
  CHECK(read_file(folder.path / "empty").empty());
  CHECK(folder.files() == 2);
}

TEST_CASE("a device is refused, since reading it may not end", "[io][unit]") {
  CHECK_THROWS_WITH(read_file("/dev/zero"), "/dev/zero: is a device, expected a file");
}

TEST_CASE("a file that cannot be read to its end is refused, not taken for an empty one",
          "[io][unit]") {
  // This opens like a file, but address 0 is not mapped and the first read fails.
  CHECK_THROWS_WITH(read_file("/proc/self/mem"),
                    "/proc/self/mem: cannot be read: Input/output error");
  // This file reports no size, but has an end.
  CHECK(read_file("/proc/self/cmdline").size() > 1);
}

TEST_CASE("a path is shortened only where that does not change the file", "[io][unit]") {
  const Folder folder;
  fs::create_directories(folder.path / "a" / "b");
  fs::create_directories(folder.path / "elsewhere" / "deep");
  fs::create_directory_symlink(folder.path / "elsewhere" / "deep", folder.path / "a" / "link");
  std::ofstream(folder.path / "elsewhere" / "f") << "above the link's target";
  std::ofstream(folder.path / "a" / "f") << "beside the link";
  CHECK(resolve_path(folder.path / "a" / "b", "../f") == folder.path / "a" / "f");
  CHECK(read_file(resolve_path(folder.path / "a" / "link", "../f")) == "above the link's target");
  CHECK(read_file(resolve_path(folder.path, "a/link/../f")) == "above the link's target");
  CHECK(resolve_path(folder.path / "a", "./b/./../f") == folder.path / "a" / "f");
  CHECK(resolve_path(folder.path / "a", "/x/y") == "/x/y");
  CHECK(resolve_path("/", "../x") == "/x");
  CHECK(resolve_path("", "../x") == "../x");
  CHECK(resolve_path("", "../../x") == "../../x");
  CHECK(resolve_path("", "") == ".");
  // The system refuses this path, so it must not become the path of another file.
  CHECK(resolve_path(folder.path, "absent/../a/f") == folder.path / "absent" / ".." / "a" / "f");
}

TEST_CASE("a failed write leaves the old file and no partial one", "[io][unit]") {
  const Folder folder;
  SECTION("where a folder has the file's name") {
    fs::create_directory(folder.path / "taken");
    std::ofstream(folder.path / "taken" / "inside") << "kept";
    CHECK_THROWS_WITH(write_file_atomically(folder.path / "taken", "new"),
                      Catch::StartsWith((folder.path / "taken").string()));
    CHECK(read_file(folder.path / "taken" / "inside") == "kept");
    CHECK(folder.files() == 1);
  }
  SECTION("where the folder does not exist") {
    try {
      write_file_atomically(folder.path / "no" / "f", "new");
      FAIL("written into a folder that does not exist");
    } catch (const Error& error) {
      CHECK(error.code() == ErrorCode::io);
      CHECK_THAT(error.what(),
                 Catch::Contains("/no/f: cannot be written: No such file or directory"));
    }
    CHECK(folder.files() == 0);
  }
  SECTION("where the folder may not be written to") {
    write_file_atomically(folder.path / "f", "old");
    fs::permissions(folder.path, fs::perms::owner_read | fs::perms::owner_exec);
    {
      const UnprivilegedUser user(folder.path);
      CHECK_THROWS_WITH(write_file_atomically(folder.path / "f", "new"),
                        Catch::Contains("Permission denied"));
    }
    CHECK(read_file(folder.path / "f") == "old");
    CHECK(folder.files() == 1);
  }
}

TEST_CASE("an unreadable file is reported with the system's reason", "[io][unit]") {
  const Folder folder;
  CHECK_THROWS_WITH(read_file(folder.path / "absent"),
                    Catch::Contains("absent: cannot be opened: No such file or directory"));
  CHECK_THROWS_WITH(read_file(folder.path), Catch::Contains("is a directory, expected a file"));
}

TEST_CASE("SHA-256 of the standard's examples", "[io][unit]") {
  // FIPS 180-2, appendix B, and the empty message
  CHECK(sha256_hex("abc") == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  CHECK(sha256_hex("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq") ==
        "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  CHECK(sha256_hex("") == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}
