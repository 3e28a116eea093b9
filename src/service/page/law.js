// A law in the first invariant, in the place of Ogden's terms.

/** The numbers of the law by the names that files have; none of a material of Ogden's terms. */
export const lawNumbers = (material) =>
  Object.entries(material).filter(([name]) => !["schema", "bulk_kpa", "terms"].includes(name));
