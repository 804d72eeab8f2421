// Numbers that are typed into one field.

import { ProblemError } from "./api.js";

export const words = (text) => text.split(/[\s,]+/).filter(Boolean);

/** A problem with a field of a form, as the service would say it. */
export function wrong(field, message, valid) {
  return new ProblemError({ title: "The form is not complete", errors: [{ field, message, valid }] });
}

/** The numbers of a text; throws ProblemError where it has other words, or not `count` of them. */
export function numbers(text, field, count) {
  const values = words(text).map(Number);
  if (values.every(Number.isFinite) && (!count || values.length === count)) return values;
  throw wrong(field, `is “${text}”`, `${count ?? "any number of"} numbers with blanks between them`);
}
