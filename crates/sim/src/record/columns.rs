//! One list of names for a sample, its message on the wire and its columns in
//! memory, so that the three cannot drift apart.

/// A value that can stand in a column of numbers.
pub(crate) trait Column: Copy {
    /// What stands where the quantity does not apply.
    const ABSENT: Self;

    /// The value as a number: flags are 0 and 1, enumerations count from 0.
    fn number(self) -> f64;
}

impl Column for f64 {
    const ABSENT: Self = Self::NAN;

    fn number(self) -> f64 {
        self
    }
}

impl Column for bool {
    const ABSENT: Self = false;

    fn number(self) -> f64 {
        f64::from(u8::from(self))
    }
}

/// Defines a sample, its message and its columns from one list of fields.
///
/// Recordings number the fields by their order here: add at the end, never
/// between, and raise [`SCHEMA_VERSION`](super::SCHEMA_VERSION) otherwise.
macro_rules! sampled {
    (
        $(#[$about:meta])*
        pub struct $sample:ident as $message:ident in $columns:ident {
            $( $(#[$doc:meta])* $field:ident : $kind:ty ),* $(,)?
        }
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $sample {
            $( $(#[$doc])* pub $field: $kind, )*
        }

        impl Default for $sample {
            /// Nothing applies: numbers are NaN, flags down.
            fn default() -> Self {
                Self { $( $field: <$kind as Column>::ABSENT, )* }
            }
        }

        impl $sample {
            /// The names of the fields, in order.
            pub const FIELDS: &'static [&'static str] = &[ $( stringify!($field) ),* ];

            /// The values in the order of [`Self::FIELDS`]; flags are 0 and 1,
            /// enumerations count from 0.
            #[must_use]
            pub fn values(&self) -> [f64; Self::FIELDS.len()] {
                [ $( self.$field.number() ),* ]
            }
        }

        /// The sample as it goes on the wire, with its time in seconds.
        #[derive(foxglove::Encode)]
        pub(crate) struct $message {
            time_s: f64,
            $( $field: $kind, )*
        }

        impl $message {
            /// The message of a sample taken at `time`.
            pub(crate) fn new(time: $crate::clock::SimTime, sample: &$sample) -> Self {
                Self { time_s: time.seconds(), $( $field: sample.$field, )* }
            }
        }

        #[doc = concat!("Every [`", stringify!($sample), "`] of a run, one column per quantity, names as in the recording.")]
        #[derive(Debug, Clone, PartialEq, Default)]
        pub struct $columns {
            /// Simulated time of each row, s.
            pub time_s: Vec<f64>,
            $( $(#[$doc])* pub $field: Vec<f64>, )*
        }

        impl $columns {
            /// How many rows there are.
            #[must_use]
            pub fn len(&self) -> usize {
                self.time_s.len()
            }

            /// Whether there are no rows.
            #[must_use]
            pub fn is_empty(&self) -> bool {
                self.time_s.is_empty()
            }

            /// The column of that name, `time_s` included.
            #[must_use]
            pub fn column(&self, name: &str) -> Option<&[f64]> {
                match name {
                    "time_s" => Some(&self.time_s),
                    $( stringify!($field) => Some(&self.$field), )*
                    _ => None,
                }
            }

            /// Columns from a lookup by name, `time_s` included; one that is missing or of another length than the time is NaN.
            #[must_use]
            pub fn from_columns(lookup: impl Fn(&str) -> Option<Vec<f64>>) -> Self {
                let time_s = lookup("time_s").unwrap_or_default();
                let count = time_s.len();
                let column = |name: &str| {
                    lookup(name)
                        .filter(|values| values.len() == count)
                        .unwrap_or_else(|| vec![f64::NAN; count])
                };
                Self {
                    $( $field: column(stringify!($field)), )*
                    time_s,
                }
            }

            /// Appends a row.
            pub(crate) fn push(&mut self, time: $crate::clock::SimTime, sample: &$sample) {
                self.time_s.push(time.seconds());
                $( self.$field.push(sample.$field.number()); )*
            }

            /// Appends a row from a lookup by name, absent values as NaN.
            pub(crate) fn push_named(&mut self, lookup: impl Fn(&str) -> Option<f64>) {
                self.time_s.push(lookup("time_s").unwrap_or(f64::NAN));
                $( self.$field.push(lookup(stringify!($field)).unwrap_or(f64::NAN)); )*
            }
        }
    };
}

pub(crate) use sampled;
