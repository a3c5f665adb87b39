// Dates and times of day in the user's way. A format is made when it is first used: that takes the browser some 10 ms,
// which the page has better uses for while it starts.

/** Writes dates like this. */
export function dateFormat(options: Intl.DateTimeFormatOptions): (date: Date) => string {
  let format: Intl.DateTimeFormat | undefined;
  return (date) => {
    format ??= new Intl.DateTimeFormat(undefined, options);
    return format.format(date);
  };
}
