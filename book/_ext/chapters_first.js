/* Weights of the search: Sphinx's own, but pages of the programming interface stand behind all chapters. */
var Scorer = {
  score: ([page, , , , score]) => (page.startsWith("_generated/api/") ? score - 1000 : score),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
