// The history of a seeker: rows as they were told, back from its columns bit for bit, refused as a whole.
#include "mgdd/optimize/ask_tell/seeker_history.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>

#include "mgdd/common/error.hpp"
#include "support/seeker_case.hpp"

namespace mgdd::optimize {
namespace {

RecordedSeeker<Spsa> two_inputs() {
  SpsaSettings settings;
  settings.space = space_at(inputs({8.0, -6.0}), 20.0);
  settings.seed = 4;
  return RecordedSeeker<Spsa>(Spsa(settings));
}

TEST(SeekerHistory, RoomThatWasMadeIsNotAllocatedAgain) {
  RecordedSeeker<Spsa> seeker = two_inputs();
  seeker.history().make_room(200);
  const double j[] = {1.0};
  const test_support::AllocationCounter counter;
  for (int k = 0; k < 200; ++k) {
    seeker.ask();
    seeker.tell({j, {}, false});
  }
  EXPECT_EQ(counter.count(), 0u);
}

TEST(SeekerHistory, ComesBackFromItsColumnsOrChangesNothing) {
  RecordedSeeker<Spsa> seeker = two_inputs();
  for (int k = 0; k < 5; ++k)
    cycle_of(seeker, [](const Inputs& x) { return x[0]; });
  const StateColumns good = seeker.history().save();
  RecordedSeeker<Spsa> other = two_inputs();
  other.history().restore(good);
  EXPECT_EQ(other.history().save(), good);

  const auto refusal = [&](const std::function<void(StateColumns&)>& spoil) -> std::string {
    StateColumns bad = good;
    spoil(bad);
    try {
      other.history().restore(bad);
    } catch (const Error& error) {
      EXPECT_EQ(other.history().save(), good);
      return error.what();
    }
    return "accepted";
  };
  EXPECT_EQ(refusal([](auto& c) { c.erase("applied"); }), "history has no column 'applied'");
  EXPECT_EQ(refusal([](auto& c) { c["applied"].pop_back(); }),
            "history column 'applied' has 9 entries: must have 10, as the others and the inputs of the seeker say");
  EXPECT_EQ(refusal([](auto& c) { c["misfire"][2] = 0.5; }),
            "history column 'misfire', entry 2, holds 0.5: must be 0 or 1");
  EXPECT_EQ(refusal([](auto& c) { c["cycle"][1] = std::nan(""); }),
            "history column 'cycle', entry 1, holds nan: must be a whole number >= 0");
}

}  // namespace
}  // namespace mgdd::optimize
