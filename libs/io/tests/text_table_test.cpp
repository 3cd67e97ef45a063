#include "hamelin/io/text_table.hpp"

#include <catch2/catch.hpp>

#include "hamelin/io/csv.hpp"

using namespace hamelin;

TEST_CASE("tables are aligned as text, and ruled as Markdown", "[io][unit]") {
  const TextTable table{{"planner", "note", "runs", "s"},
                        {{"apf", "x", "7", "0.25"}, {"hybrid+guide", "", "1000", "-"}},
                        2};
  CHECK(to_text(table) ==
        "planner       note  runs     s\n"
        "apf           x        7  0.25\n"
        "hybrid+guide        1000     -\n");
  CHECK(to_markdown(table) ==
        "| planner | note | runs | s |\n"
        "| --- | --- | --: | --: |\n"
        "| apf | x | 7 | 0.25 |\n"
        "| hybrid+guide |  | 1000 | - |\n");
}

TEST_CASE("CSV fields are quoted if they must be", "[io][unit]") {
  CHECK(csv_field("plain text") == "plain text");
  CHECK(csv_field("a,b") == "\"a,b\"");
  CHECK(csv_field("say \"it\"\n") == "\"say \"\"it\"\"\n\"");
  CHECK(csv_field("").empty());
}
