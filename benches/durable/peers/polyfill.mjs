// Node before 22 lacks what the SDK uses.
Promise.withResolvers ??= function () {
  let resolve, reject;
  const promise = new this((onward, away) => { resolve = onward; reject = away; });
  return { promise, resolve, reject };
};
