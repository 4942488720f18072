// What to do comes before what was measured: the score of a page depends on what kind of page it is.
var Scorer = {
  score: ([page, , , , score]) => {
    if (/^(howto|getting_started)$/.test(page)) return score + 20;
    if (/^(changelog|.*benchmarks|study_.*|validation|notebooks\/.*)$/.test(page)) return score - 20;
    return score;
  },
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
